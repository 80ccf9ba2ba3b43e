// The counting allocator as a library that is loaded in front of the C library (LD_PRELOAD): bench/run.py counts what timed queries do.
#include "tests/support/count_heap.h"

// Switches the counter on or off; calls that were counted so far.
extern "C" long long engram_count_heap(bool on) {
  counting = on;
  return calls;
}
