#ifndef BENCH_POLE_WITNESS_H_
#define BENCH_POLE_WITNESS_H_

#include "controller/engram.h"

// Talos at the pole with a planner that is watched: whatever the memory puts in the place of the shifted plan is rolled out beside it.
extern "C" const engram_model engram_talos_pole_witness;

struct PoleWitness {
  long asked, accepted;  // answers of the memory; those that took the shifted plan's place
  long above;            // of these: those that cost more, rolled out
  double worst;          // largest excess, relative to the shifted plan's cost
};
PoleWitness& pole_witness();

// From now on the memory's tables are random numbers of a plausible size, with a valid digest.
void pole_random_tables();

#endif  // BENCH_POLE_WITNESS_H_
