#include "controller/tab/tab_rbf.h"

#include <cmath>

extern "C" {

TabStatus tab_rbf_basis(const TabRbf* tab, int32_t nt, const double* t, double* phi, double* dphi) {
  const double lo = tab->head.array[0].data[0], hi = tab->head.array[1].data[0];
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
  for (int32_t row = 0; row < nt; ++row, phi += tab->k, y += count) {
    for (int32_t j = 0; j < count; ++j) y[j] = 0;
    for (int32_t i = 0; i < tab->k; ++i) {
      const float* weight = w + static_cast<int64_t>(i) * tab->nchannel + first;
      for (int32_t j = 0; j < count; ++j) y[j] += phi[i] * weight[j];
    }
  }
}

}  // extern "C"
