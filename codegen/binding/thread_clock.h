#ifndef CODEGEN_BINDING_THREAD_CLOCK_H_
#define CODEGEN_BINDING_THREAD_CLOCK_H_

#include <ctime>

namespace engram::binding {

// Processor time of this thread [us]
inline double thread_us() {
  timespec t;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return 1e6 * double(t.tv_sec) + 1e-3 * double(t.tv_nsec);
}

}  // namespace engram::binding
#endif  // CODEGEN_BINDING_THREAD_CLOCK_H_
