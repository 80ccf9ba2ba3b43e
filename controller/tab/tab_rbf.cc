#include "controller/tab/tab_rbf.h"

#include "controller/tab/tab_lanes.h"

#include <cmath>

using engram::TabDoubles;

extern "C" {

TabStatus tab_rbf_basis(const TabRbf* tab, int32_t nt, const double* t, double* phi, double* dphi) {
  const double lo = tab_lo(&tab->head)[0], hi = tab_hi(&tab->head)[0];
  const double inv_width = 1.0 / tab->width;
  const int32_t k = tab->k;
  TabStatus status = kTabOk;
  for (int32_t row = 0; row < nt; ++row, phi += k) {
    const bool finite = std::isfinite(t[row]);
    const double time = finite ? std::fmin(std::fmax(t[row], lo), hi) : lo;
    const bool inside = time == t[row];
    if (!inside) status = tab_worse(status, finite ? kTabOutside : kTabNotFinite);

    // exponents relative to the nearest Gaussian, so that the sum never underflows
    double z[TAB_RBF_MAX_K], nearest = INFINITY, sum = 0;
    for (int32_t i = 0; i < k; ++i) {
      z[i] = (time - tab->center[i]) * inv_width;
      nearest = std::fmin(nearest, z[i] * z[i]);
    }
    for (int32_t i = 0; i < k; ++i) {
      phi[i] = std::exp(0.5 * (nearest - z[i] * z[i]));
      sum += phi[i];
    }
    const double scale = finite ? 1.0 / sum : 0.0;
    for (int32_t i = 0; i < k; ++i) phi[i] *= scale;

    // phi_k' = phi_k (g_k'/g_k - sum_j phi_j g_j'/g_j),  g'/g = -z / h
    if (dphi) {
      double mean = 0;
      for (int32_t i = 0; i < k; ++i) mean += phi[i] * z[i];
      for (int32_t i = 0; i < k; ++i) dphi[i] = inside ? phi[i] * (mean - z[i]) * inv_width : 0.0;
      dphi += k;
    }
  }
  return status;
}

void tab_rbf_eval(const TabRbf* tab, const float* w, int32_t first, int32_t count, int32_t nt, const double* phi, double* y) {
  // eight channels at a time: their weights as doubles, then one pass over the rows
  for (int32_t block = 0; block < count; block += TAB_LANES) {
    const int32_t channels = count - block < TAB_LANES ? count - block : TAB_LANES;
    TabDoubles weight[TAB_RBF_MAX_K][2] = {};
    for (int32_t i = 0; i < tab->k; ++i) {
      const float* source = w + static_cast<int64_t>(i) * tab->nchannel + first + block;
      for (int32_t j = 0; j < channels; ++j) weight[i][j / 4][j % 4] = source[j];
    }
    for (int32_t row = 0; row < nt; ++row) {
      TabDoubles sum[2] = {};
      const double* basis = phi + static_cast<int64_t>(row) * tab->k;
      for (int32_t i = 0; i < tab->k; ++i) {
        sum[0] += basis[i] * weight[i][0];
        sum[1] += basis[i] * weight[i][1];
      }
      for (int32_t j = 0; j < channels; ++j) y[static_cast<int64_t>(row) * count + block + j] = sum[j / 4][j % 4];
    }
  }
}

}  // extern "C"
