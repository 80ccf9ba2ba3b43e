#include "controller/tab/tab_tt.h"

#include "controller/tab/tab_tt_core.h"

using namespace engram;

extern "C" {

TabStatus tab_tt_value(const TabTt* tab, const double* x, double* value, double* gradient) {
  const int32_t d = tab->d;
  *value = 0;
  if (gradient) std::memset(gradient, 0, sizeof(double) * d);
  const TabStatus status = tab_domain(&tab->head, x);
  if (status == kTabNotFinite) return status;

  // where the cores begin
  int64_t offset[TAB_TT_MAX_D];
  int64_t end = 0;
  for (int32_t k = 0; k < d; ++k) {
    offset[k] = end;
    end += tt_core(tab, k, end).size();
  }

  // right_k = P^k(x_k) ... P^d(x_d), without 2^exponent
  alignas(64) float right[TAB_TT_MAX_D + 1][TAB_TT_MAX_R];
  int32_t exponent[TAB_TT_MAX_D + 1];
  if (gradient) {
    std::memset(right[d], 0, sizeof right[d]);
    right[d][0] = 1;
    exponent[d] = 0;
    for (int32_t k = d - 1; k > 0; --k) {
      const TtCore core = tt_core(tab, k, offset[k]);
      const TtPoint at = tt_point(tab, k, x[k]);
      float a[TAB_TT_MAX_R], b[TAB_TT_MAX_R] = {};
      tt_slice_times_column(core, at.i, right[k + 1], a, 1);
      if (core.n > 1) tt_slice_times_column(core, at.i + 1, right[k + 1], b, 1);
      std::memset(right[k], 0, sizeof right[k]);
      for (int32_t j = 0; j < core.rows; ++j) right[k][j] = ((1 - at.t) * a[j] + at.t * b[j]) * tab->scale[k];
      exponent[k] = exponent[k + 1] + tt_rescale(right[k], core.rows);
    }
  }

  // left = P^1(x_1) ... P^k(x_k), without 2^left_exponent
  alignas(64) float left[TAB_TT_MAX_R] = {1};
  int32_t left_exponent = 0;
  for (int32_t k = 0; k < d; ++k) {
    const TtCore core = tt_core(tab, k, offset[k]);
    const TtPoint at = tt_point(tab, k, x[k]);
    alignas(64) float a[TAB_TT_MAX_R], b[TAB_TT_MAX_R] = {};
    tt_row_times_slice(core, at.i, left, a);
    if (core.n > 1) tt_row_times_slice(core, at.i + 1, left, b);
    if (gradient && at.inside) {
      double slope = 0;
      for (int32_t j = 0; j < core.columns; ++j) slope += static_cast<double>(b[j] - a[j]) * right[k + 1][j];
      gradient[k] = std::ldexp(slope * tab->scale[k], left_exponent + exponent[k + 1]) / at.step;
    }
    for (int32_t j = 0; j < core.columns; ++j) left[j] = ((1 - at.t) * a[j] + at.t * b[j]) * tab->scale[k];
    left_exponent += tt_rescale(left, core.columns);
  }
  *value = std::ldexp(static_cast<double>(left[0]), left_exponent);
  return status;
}

TabStatus tab_tt_distance(const TabTt* tab, const double* p, float* distance, float* gradient) {
  *distance = 0;
  for (int i = 0; gradient && i < 3; ++i) gradient[i] = 0;
  if (tab->d != 3) return kTabBad;
  double value, slope[3];
  const TabStatus status = tab_tt_value(tab, p, &value, gradient ? slope : nullptr);
  if (status == kTabNotFinite) return status;
  double beyond[3], far = 0;
  for (int i = 0; i < 3; ++i) {
    beyond[i] = p[i] - std::fmin(std::fmax(p[i], tab_lo(&tab->head)[i]), tab_hi(&tab->head)[i]);
    far = std::hypot(far, beyond[i]);
  }
  *distance = static_cast<float>(value + far);
  // beyond a border the nearest point of the domain no longer moves along its axis: the train's slope is 0 there
  for (int i = 0; gradient && i < 3; ++i) gradient[i] = static_cast<float>(beyond[i] != 0 ? beyond[i] / far : slope[i]);
  return status;
}

void tab_lowest(const double* cost, int32_t n, int32_t k, int32_t* index) {
  for (int32_t j = 0; j < k; ++j) index[j] = -1;
  for (int32_t i = 0; i < n; ++i) {
    int32_t at = k;
    // strict, so that among equals the earlier one stays ahead; NaN is below nothing
    const auto below = [&](int32_t j) { return j < 0 || cost[i] < cost[j] || (cost[j] != cost[j] && cost[i] == cost[i]); };
    while (at > 0 && below(index[at - 1])) --at;
    for (int32_t j = k - 1; j > at; --j) index[j] = index[j - 1];
    if (at < k) index[at] = i;
  }
}

}  // extern "C"
