#include "controller/tab/tab_gpr.h"

#include "controller/tab/tab_lanes.h"

#include <cmath>

using namespace engram;

extern "C" TabStatus tab_gpr_query(const TabGpr* tab, const double* x, float* mean, float* var) {
  const int32_t n = tab->n, m_pad = tab_pad(tab->m);
  std::memcpy(mean, tab->mean, sizeof(float) * m_pad);
  if (var) *var = tab->variance + tab->noise;
  const TabStatus status = tab_domain(&tab->head, x);
  if (status == kTabNotFinite) return status;

  float query[TAB_MAX_IN];
  for (int32_t i = 0; i < tab->d; ++i) {
    query[i] = std::fmin(std::fmax(static_cast<float>(x[i]) * tab->inv_length[i], -TAB_FAR), TAB_FAR);
  }

  // k(X, x); padding samples are so far away that theirs is 0
  alignas(64) float kernel[TAB_GPR_MAX_N];
  const float* block = tab->x;
  for (int32_t first = 0; first < n; first += TAB_LANES, block += tab->d * TAB_LANES) {
    const TabLanes d2 = tab_block_distance2(block, query, tab->d);
    for (int32_t lane = 0; lane < TAB_LANES; ++lane) kernel[first + lane] = tab->variance * std::exp(-0.5f * d2[lane]);
  }

  // mean = y0 + alpha' k, one vector of outputs at a time
  for (int32_t j = 0; j < m_pad; j += TAB_LANES) {
    TabLanes sum{};
    for (int32_t i = 0; i < n; ++i) sum += tab_load(tab->alpha + static_cast<int64_t>(i) * m_pad + j) * kernel[i];
    tab_store(mean + j, tab_load(mean + j) + sum);
  }

  // var = s + noise - |Linv k|^2
  if (var && tab->linv) {
    double explained = 0;
    const float* row = tab->linv;
    for (int32_t i = 0; i < n; ++i) {
      TabLanes dot{};
      const int32_t length = tab_pad(i + 1);
      for (int32_t j = 0; j < length; j += TAB_LANES) dot += tab_load(row + j) * tab_load(kernel + j);
      const double v = tab_sum(dot);
      explained += v * v;
      row += length;
    }
    *var = static_cast<float>(std::fmax(0.0, static_cast<double>(tab->variance) + tab->noise - explained));
  }
  return status;
}
