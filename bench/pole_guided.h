#ifndef BENCH_POLE_GUIDED_H_
#define BENCH_POLE_GUIDED_H_

#include "controller/engram.h"

extern "C" const engram_model engram_talos_pole_guided;

#endif  // BENCH_POLE_GUIDED_H_
