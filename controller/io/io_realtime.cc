#include "controller/io/io_realtime.h"

#include <pthread.h>
#include <sched.h>
#include <sys/mman.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <ctime>

namespace engram::io {

double thread_cpu_us() {
  timespec t;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return 1e6 * static_cast<double>(t.tv_sec) + 1e-3 * static_cast<double>(t.tv_nsec);
}

void go_realtime(int priority) {
  if (mlockall(MCL_CURRENT | MCL_FUTURE) != 0) {
    std::fprintf(stderr, "engram-controller: --realtime: memory not locked (%s): raise 'ulimit -l' or run as root\n",
                 std::strerror(errno));
  }
  sched_param param = {};
  param.sched_priority = priority;
  const int error = pthread_setschedparam(pthread_self(), SCHED_FIFO, &param);
  if (error != 0) {
    std::fprintf(stderr, "engram-controller: --realtime: no real-time priority (%s): raise 'ulimit -r' or run as root\n",
                 std::strerror(error));
  }
}

}  // namespace engram::io
