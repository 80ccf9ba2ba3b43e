// Eight floats or four doubles side by side, and what the evaluators share. Internal to controller/tab.
#ifndef CONTROLLER_TAB_TAB_LANES_H_
#define CONTROLLER_TAB_TAB_LANES_H_

#include "controller/tab/tab.h"

#include <cstring>
#include <type_traits>

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

// Eight half floats or signed bytes, as floats (the caller multiplies by their scale). Halves are moved into the place of a float's
// bits and their exponent is moved by 112; there are no infinities or denormals among them (engram.emit).
inline TabLanes tab_load_half(const uint16_t* p) {
  typedef uint16_t Halves __attribute__((vector_size(TAB_LANES * sizeof(uint16_t))));
  typedef uint32_t Words __attribute__((vector_size(TAB_LANES * sizeof(uint32_t))));
  Halves half;
  std::memcpy(&half, p, sizeof half);
  const Words wide = __builtin_convertvector(half, Words);
  const Words size = wide & 0x7fff, sign = wide & 0x8000;
  const Words bits = (size << 13) + (reinterpret_cast<Words>(size != 0) & (112u << 23)) + (sign << 16);
  TabLanes v;
  std::memcpy(&v, &bits, sizeof v);
  return v;
}
inline TabLanes tab_load_byte(const int8_t* p) {
  // Every byte is shuffled to the top of a word of its own, then shifted down with its sign: gcc 12 converts them one by one otherwise.
  typedef int8_t Bytes __attribute__((vector_size(sizeof(TabLanes))));
  typedef int32_t Words __attribute__((vector_size(sizeof(TabLanes))));
  typedef int64_t Quads __attribute__((vector_size(sizeof(TabLanes))));
  int64_t eight;
  std::memcpy(&eight, p, sizeof eight);
  const Bytes top = {0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0, 3, 16, 16, 16, 20, 16, 16, 16, 21, 16, 16, 16, 22, 16, 16, 16, 23};
  const Bytes spread = __builtin_shuffle(reinterpret_cast<Bytes>(Quads{} + eight), top);
  return __builtin_convertvector(reinterpret_cast<Words>(spread) >> 24, TabLanes);
}

// Eight numbers of an array of a type, from number i on.
template <int type> inline TabLanes tab_load_as(const void* data, int64_t i) {
  if constexpr (type == kTabFloat32) return tab_load(static_cast<const float*>(data) + i);
  else if constexpr (type == kTabFloat16) return tab_load_half(static_cast<const uint16_t*>(data) + i);
  else return tab_load_byte(static_cast<const int8_t*>(data) + i);
}

// One number of an array of a type.
template <int type> inline float tab_at(const void* data, int64_t i) {
  if constexpr (type == kTabFloat32) return static_cast<const float*>(data)[i];
  else if constexpr (type == kTabInt8) return static_cast<const int8_t*>(data)[i];
  else {
    const uint16_t half[TAB_LANES] = {static_cast<const uint16_t*>(data)[i]};
    return tab_load_half(half)[0];
  }
}

// f(integral constant of the type): one instance of an inner loop for every type.
template <class F> inline auto tab_with_type(int32_t type, F f) {
  switch (type) {
    case kTabFloat16: return f(std::integral_constant<int, kTabFloat16>());
    case kTabInt8: return f(std::integral_constant<int, kTabInt8>());
    default: return f(std::integral_constant<int, kTabFloat32>());
  }
}

inline float tab_sum(const TabLanes& v) { return ((v[0] + v[4]) + (v[2] + v[6])) + ((v[1] + v[5]) + (v[3] + v[7])); }
inline float tab_max(const TabLanes& v) {
  const auto larger = [](float a, float b) { return a > b ? a : b; };
  return larger(larger(larger(v[0], v[4]), larger(v[2], v[6])), larger(larger(v[1], v[5]), larger(v[3], v[7])));
}

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
