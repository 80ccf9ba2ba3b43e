#ifndef CODEGEN_BINDING_THREAD_CLOCK_H_
#define CODEGEN_BINDING_THREAD_CLOCK_H_

#include <ctime>

// Of bench/count_heap.cc, where it is loaded in front of the C library: calls of the allocators so far, counted while `on`.
extern "C" __attribute__((weak)) long long engram_count_heap(bool on);

namespace engram::binding {

// Processor time of this thread [us]
inline double thread_us() {
  timespec t;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return 1e6 * double(t.tv_sec) + 1e-3 * double(t.tv_nsec);
}

// Processor time of f [us]; its calls of the allocators are counted, if somebody does.
template <class F> double timed_us(F&& f) {
  if (engram_count_heap) engram_count_heap(true);
  const double start = thread_us();
  f();
  const double us = thread_us() - start;
  if (engram_count_heap) engram_count_heap(false);
  return us;
}

}  // namespace engram::binding
#endif  // CODEGEN_BINDING_THREAD_CLOCK_H_
