// Eight floats or four doubles side by side, and what the evaluators share. Internal to controller/tab.
#ifndef CONTROLLER_TAB_TAB_LANES_H_
#define CONTROLLER_TAB_TAB_LANES_H_

#include "controller/tab/tab.h"

#include <cstring>

namespace engram {

#pragma GCC diagnostic ignored "-Wpsabi"  // on a target without AVX: these functions are inlined, no ABI is crossed

typedef float TabLanes __attribute__((vector_size(TAB_LANES * sizeof(float))));
typedef double TabDoubles __attribute__((vector_size(TAB_LANES * sizeof(float))));

inline TabLanes tab_load(const float* p) {
  TabLanes v;
  std::memcpy(&v, p, sizeof v);
  return v;
}
inline void tab_store(float* p, const TabLanes& v) { std::memcpy(p, &v, sizeof v); }
inline TabLanes tab_fill(float s) { return TabLanes{} + s; }
inline float tab_sum(const TabLanes& v) { return ((v[0] + v[4]) + (v[2] + v[6])) + ((v[1] + v[5]) + (v[3] + v[7])); }

// Squared distances of the scaled query to the eight samples of one block (d, 8). Two accumulators hide the latency of the additions.
inline TabLanes tab_block_distance2(const float* block, const float* query, int32_t d) {
  TabLanes even{}, odd{};
  int32_t i = 0;
  for (; i + 1 < d; i += 2) {
    const TabLanes a = tab_load(block + i * TAB_LANES) - query[i];
    const TabLanes b = tab_load(block + (i + 1) * TAB_LANES) - query[i + 1];
    even += a * a;
    odd += b * b;
  }
  if (i < d) {
    const TabLanes a = tab_load(block + i * TAB_LANES) - query[i];
    even += a * a;
  }
  return even + odd;
}

}  // namespace engram
#endif  // CONTROLLER_TAB_TAB_LANES_H_
