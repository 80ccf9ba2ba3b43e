// What seeds the solver, by its name on a command line.
#ifndef BENCH_MODES_H_
#define BENCH_MODES_H_

#include <string>

#include "bench/stopwatch.h"
#include "controller/engram.h"

namespace bench {

// memory=NAME; ends the program if it is none.
inline engram_mode mode_of(const std::string& name) {
  if (name != "memory" && name != "shift" && name != "cold") fail("memory=" + name + ": it is one of memory, shift, cold");
  return name == "memory" ? ENGRAM_MODE_MEMORY : name == "shift" ? ENGRAM_MODE_SHIFT : ENGRAM_MODE_COLD;
}

}  // namespace bench
#endif  // BENCH_MODES_H_
