// Cores of a tensor train: where they lie, and rows and columns times their slices. Internal to controller/tab.
#ifndef CONTROLLER_TAB_TAB_TT_CORE_H_
#define CONTROLLER_TAB_TAB_TT_CORE_H_

#include "controller/tab/tab_lanes.h"
#include "controller/tab/tab_tt.h"

#include <cmath>

namespace engram {

inline int32_t tt_n(const TabTt* tab, int32_t k) { return static_cast<int32_t>(tab->shape[k]); }
inline int32_t tt_r(const TabTt* tab, int32_t k) { return static_cast<int32_t>(tab->shape[tab->d + k]); }

// One core, k = 0 .. d - 1.
struct TtCore {
  int32_t type, n, rows, columns, width;
  int64_t offset;  // of its first number
  const void* data;

  int64_t slice(int32_t i) const { return offset + static_cast<int64_t>(i) * rows * width; }
  int64_t size() const { return static_cast<int64_t>(n) * rows * width; }
  const void* address(int32_t i) const { return static_cast<const char*>(data) + slice(i) * (type == kTabInt8 ? 1 : 4); }
};
inline TtCore tt_core(const TabTt* tab, int32_t k, int64_t offset) {
  const int32_t columns = tt_r(tab, k + 1);
  return {tab->type, tt_n(tab, k), tt_r(tab, k), columns, tab_tt_width(columns), offset, tab->core};
}

// A point between grid points i and i + 1: x = point i + t steps; `inside` is false where x was moved to the border of the domain.
struct TtPoint {
  int32_t i;
  float t;
  double step;
  bool inside;
};
inline TtPoint tt_point(const TabTt* tab, int32_t k, double x) {
  const double lo = tab_lo(&tab->head)[k], hi = tab_hi(&tab->head)[k];
  const int32_t n = tt_n(tab, k);
  const double step = n > 1 ? (hi - lo) / (n - 1) : 0.0;
  if (n < 2 || !(hi > lo)) return {0, 0.0f, 0.0, false};
  const double at = std::fmin(std::fmax((x - lo) / step, 0.0), n - 1.0);
  const int32_t i = at < n - 2.0 ? static_cast<int32_t>(at) : n - 2;
  return {i, static_cast<float>(at - i), step, x >= lo && x <= hi};
}

// out_g[c ..] = sum_j row_g[j] M[j][c ..] for G rows, side by side (rows, G), and V vectors of columns; M (rows, width) begins at
// number `at`. `ahead`, unless null, is a matrix as large that is wanted next: row j of it is asked for at row j, into the second cache.
template <int type, int G, int V>
inline void tt_product(const float* row, int32_t rows, const void* data, int64_t at, int32_t width, int32_t c, float* const* out,
                       const void* ahead) {
  const int32_t row_bytes = width * (type == kTabInt8 ? 1 : 4);
  const char* next = static_cast<const char*>(ahead);
  TabLanes sum[G][V];
#pragma GCC unroll 32
  for (int i = 0; i < G * V; ++i) sum[i / V][i % V] = TabLanes{};
  for (int32_t j = 0; j < rows; ++j) {
    for (int32_t b = 0; next && b < row_bytes; b += 64) __builtin_prefetch(next + j * row_bytes + b, 0, 2);
    TabLanes m[V];
#pragma GCC unroll 8
    for (int v = 0; v < V; ++v) m[v] = tab_load_as<type>(data, at + static_cast<int64_t>(j) * width + c + v * TAB_LANES);
#pragma GCC unroll 32
    for (int i = 0; i < G * V; ++i) sum[i / V][i % V] += m[i % V] * row[j * G + i / V];
  }
#pragma GCC unroll 32
  for (int i = 0; i < G * V; ++i) tab_store(out[i / V] + c + i % V * TAB_LANES, sum[i / V][i % V]);
}

// The same for a number of vectors that is known when it runs: 1 .. V.
template <int type, int G, int V>
inline void tt_pass(int32_t vectors, const float* row, int32_t rows, const void* data, int64_t at, int32_t width, int32_t c, float* const* out,
                    const void* ahead) {
  if (vectors == V) return tt_product<type, G, V>(row, rows, data, at, width, c, out, ahead);
  if constexpr (V > 1) tt_pass<type, G, V - 1>(vectors, row, rows, data, at, width, c, out, ahead);
}

// out_g = row_g M for G rows, in as few passes over the rows of M as registers allow, all of about the same number of vectors.
template <int type, int G>
inline void tt_rows_times(const float* const* row, int32_t rows, const void* data, int64_t at, int32_t width, float* const* out,
                          const void* ahead = nullptr) {
  constexpr int kMost = G == 1 ? 8 : G == 2 ? 7 : 3;
  alignas(64) float packed[G > 1 ? TAB_TT_MAX_R * G : 1];
  for (int32_t j = 0; G > 1 && j < rows; ++j)
    for (int g = 0; g < G; ++g) packed[j * G + g] = row[g][j];
  const float* const side_by_side = G > 1 ? packed : row[0];
  int32_t left = width / TAB_LANES;
  for (int32_t passes = (left + kMost - 1) / kMost, c = 0; passes > 0; --passes) {
    const int32_t vectors = (left + passes - 1) / passes;
    tt_pass<type, G, kMost>(vectors, side_by_side, rows, data, at, width, c, out, c == 0 ? ahead : nullptr);
    left -= vectors;
    c += vectors * TAB_LANES;
  }
}

template <int type> inline float tt_number(const void* data, int64_t at) {
  if constexpr (type == kTabInt8) return static_cast<float>(static_cast<const int8_t*>(data)[at]);
  else return static_cast<const float*>(data)[at];
}

// out_g (width) = row_g (rows) times slice i for G rows; `ahead`: null, or the address of the next slice
template <int G>
inline void tt_rows_times_slice(const TtCore& core, int32_t i, const float* const* row, float* const* out, const void* ahead = nullptr) {
  const auto times = [&](auto type) {
    const int64_t at = core.slice(i);
    if (core.width > 1) return tt_rows_times<type, G>(row, core.rows, core.data, at, core.width, out, ahead);
    for (int g = 0; g < G; ++g) {
      float sum = 0;
      for (int32_t j = 0; j < core.rows; ++j) sum += row[g][j] * tt_number<type>(core.data, at + j);
      out[g][0] = sum;
    }
  };
  if (core.type == kTabInt8) times(std::integral_constant<int, kTabInt8>());
  else times(std::integral_constant<int, kTabFloat32>());
}
inline void tt_row_times_slice(const TtCore& core, int32_t i, const float* row, float* out) {
  tt_rows_times_slice<1>(core, i, &row, &out);
}

// out (rows), `stride` apart, = slice i times column (width)
inline void tt_slice_times_column(const TtCore& core, int32_t i, const float* column, float* out, int32_t stride) {
  const auto times = [&](auto type) {
    int64_t at = core.slice(i);
    for (int32_t j = 0; j < core.rows; ++j, at += core.width) {
      if (core.width == 1) {
        out[j * stride] = tt_number<type>(core.data, at) * column[0];
        continue;
      }
      TabLanes sum{};
      for (int32_t c = 0; c < core.width; c += TAB_LANES) sum += tab_load_as<type>(core.data, at + c) * tab_load(column + c);
      out[j * stride] = tab_sum(sum);
    }
  };
  if (core.type == kTabInt8) times(std::integral_constant<int, kTabInt8>());
  else times(std::integral_constant<int, kTabFloat32>());
}

// Divides v by a power of two so that its largest entry lies in [1, 2); returns the exponent. 0 where v vanishes or is not finite.
inline int32_t tt_rescale(float* v, int32_t n) {
  TabLanes top{};
  int32_t i = 0;
  for (; i + TAB_LANES <= n; i += TAB_LANES) {
    const TabLanes a = tab_load(v + i), size = a < 0.0f ? -a : a;
    top = size > top ? size : top;
  }
  float largest = tab_max(top);
  for (; i < n; ++i) largest = std::fabs(v[i]) > largest ? std::fabs(v[i]) : largest;
  uint32_t bits;
  std::memcpy(&bits, &largest, sizeof bits);
  const int32_t biased = static_cast<int32_t>(bits >> 23);
  if (biased == 0 || biased >= 254) return 0;
  const uint32_t inverse_bits = static_cast<uint32_t>(254 - biased) << 23;
  float inverse;
  std::memcpy(&inverse, &inverse_bits, sizeof inverse);
  for (i = 0; i + TAB_LANES <= n; i += TAB_LANES) tab_store(v + i, tab_load(v + i) * inverse);
  for (; i < n; ++i) v[i] *= inverse;
  return biased - 127;
}

}  // namespace engram
#endif  // CONTROLLER_TAB_TAB_TT_CORE_H_
