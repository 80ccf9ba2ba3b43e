#include "controller/tab/tab_gmr.h"

#include "controller/tab/tab_lanes.h"

#include <cmath>

using namespace engram;

namespace {

// x - mu_x of component k, as floats that cannot overflow when squared in double
void difference(const TabGmr* tab, int32_t k, const double* x, float* dx) {
  const float* mean = tab->mean_x + static_cast<int64_t>(k) * tab_pad(tab->d);
  for (int32_t i = 0; i < tab->d; ++i) dx[i] = static_cast<float>(std::fmin(std::fmax(x[i] - mean[i], -double{TAB_FAR}), double{TAB_FAR}));
}

// q = |L^-1 dx|^2 of component k
double distance2(const TabGmr* tab, int32_t k, const float* dx) {
  const int32_t d_pad = tab_pad(tab->d);
  const float* column = tab->linv + static_cast<int64_t>(k) * tab->d * d_pad;
  TabLanes z[TAB_MAX_IN / TAB_LANES] = {};
  for (int32_t j = 0; j < tab->d; ++j, column += d_pad) {
    // L^-1 is lower triangular: column j starts at row j
    for (int32_t i = j / TAB_LANES; i < d_pad / TAB_LANES; ++i) z[i] += tab_load(column + i * TAB_LANES) * dx[j];
  }
  double q = 0;
  for (int32_t i = 0; i < d_pad / TAB_LANES; ++i) {
    for (int32_t lane = 0; lane < TAB_LANES; ++lane) q += double{z[i][lane]} * z[i][lane];
  }
  return q;
}

// h (k): probabilities of the components given x; q (k)
void responsibilities(const TabGmr* tab, const double* x, double* h, double* q) {
  double largest = -INFINITY, sum = 0;
  for (int32_t k = 0; k < tab->k; ++k) {
    float dx[TAB_MAX_IN];
    difference(tab, k, x, dx);
    q[k] = distance2(tab, k, dx);
    const double nu = tab->freedom[k];
    h[k] = tab->log_norm[k] - (nu > 0 ? 0.5 * (nu + tab->d) * std::log1p(q[k] / nu) : 0.5 * q[k]);
    largest = std::fmax(largest, h[k]);
  }
  for (int32_t k = 0; k < tab->k; ++k) sum += h[k] = std::exp(h[k] - largest);
  for (int32_t k = 0; k < tab->k; ++k) h[k] /= sum;
}

// y_k, and where not null its variances
void conditional(const TabGmr* tab, int32_t k, double q, const double* x, float* y, float* var) {
  const int32_t m_pad = tab_pad(tab->m);
  const int64_t row = static_cast<int64_t>(k) * m_pad;
  float dx[TAB_MAX_IN];
  difference(tab, k, x, dx);
  tab_with_type(tab->slope_type, [&](auto type) {
    for (int32_t j = 0; j < m_pad; j += TAB_LANES) {
      TabLanes sum{};
      for (int32_t i = 0; i < tab->d; ++i) sum += tab_load_as<type>(tab->slope, row * tab->d + static_cast<int64_t>(i) * m_pad + j) * dx[i];
      tab_store(y + j, tab_load(tab->mean_y + row + j) + sum * tab_load(tab->slope_scale + j));
    }
  });
  if (!var) return;
  const double nu = tab->freedom[k];
  const float spread = nu > 0 ? static_cast<float>((nu + q) / (nu + tab->d - 2)) : 1.0f;
  for (int32_t j = 0; j < m_pad; ++j) var[j] = spread * tab->var[row + j];
}

}  // namespace

extern "C" {

TabStatus tab_gmr_modes(const TabGmr* tab, const double* x, int32_t count, int32_t* index, float* weight, float* y, float* var) {
  const int32_t m_pad = tab_pad(tab->m);
  const TabStatus status = tab_domain(&tab->head, x);
  double h[TAB_GMR_MAX_K], q[TAB_GMR_MAX_K];
  if (status != kTabNotFinite) responsibilities(tab, x, h, q);
  for (int32_t i = 0; i < count; ++i, y += m_pad, var = var ? var + m_pad : var) {
    int32_t best = -1;
    for (int32_t k = 0; k < tab->k && status != kTabNotFinite; ++k) {
      if (h[k] >= 0 && (best < 0 || h[k] > h[best])) best = k;
    }
    index[i] = best;
    weight[i] = best < 0 ? 0.0f : static_cast<float>(h[best]);
    if (best < 0) {
      std::memset(y, 0, sizeof(float) * m_pad);
      if (var) std::memset(var, 0, sizeof(float) * m_pad);
      continue;
    }
    conditional(tab, best, q[best], x, y, var);
    h[best] = -1;  // taken
  }
  return status;
}

TabStatus tab_gmr_moments(const TabGmr* tab, const double* x, float* mean, float* var) {
  const int32_t m_pad = tab_pad(tab->m);
  std::memset(mean, 0, sizeof(float) * m_pad);
  if (var) std::memset(var, 0, sizeof(float) * m_pad);
  const TabStatus status = tab_domain(&tab->head, x);
  if (status == kTabNotFinite) return status;
  double h[TAB_GMR_MAX_K], q[TAB_GMR_MAX_K];
  responsibilities(tab, x, h, q);
  double weight = 0;
  for (int32_t k = 0; k < tab->k; ++k) {
    if (h[k] == 0) continue;
    alignas(64) float y[TAB_GMR_MAX_M], v[TAB_GMR_MAX_M];
    conditional(tab, k, q[k], x, y, var ? v : nullptr);
    // running mean and variance, free of cancellation:  W' = W + h,  delta = y - mean,  mean' = mean + h / W' delta,
    // var' = (W var + h (v + W / W' delta^2)) / W'
    const double total = weight + h[k];
    const float share = static_cast<float>(h[k] / total), rest = static_cast<float>(weight / total);
    for (int32_t j = 0; j < m_pad; ++j) {
      const float delta = y[j] - mean[j];
      mean[j] += share * delta;
      if (var) var[j] = rest * var[j] + share * (v[j] + rest * delta * delta);
    }
    weight = total;
  }
  return status;
}

}  // extern "C"
