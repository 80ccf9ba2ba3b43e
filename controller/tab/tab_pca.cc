#include "controller/tab/tab_pca.h"

#include "controller/tab/tab_lanes.h"

#include <cmath>

using namespace engram;

extern "C" TabStatus tab_pca_decode(const TabPca* tab, const float* z, float* y) {
  const float* lo = tab_lo(&tab->head);
  const float* hi = tab_hi(&tab->head);
  const int32_t n_pad = tab_pad(tab->n);
  std::memcpy(y, tab->mean, sizeof(float) * n_pad);
  TabStatus status = kTabOk;
  for (int32_t i = 0; i < tab->m; ++i) {
    if (!std::isfinite(z[i])) return kTabNotFinite;
    if (z[i] < lo[i] || z[i] > hi[i]) status = kTabOutside;
  }
  for (int32_t j = 0; j < n_pad; j += TAB_LANES) {
    TabLanes sum = tab_load(y + j);
    for (int32_t i = 0; i < tab->m; ++i) sum += tab_load(tab->basis + static_cast<int64_t>(i) * n_pad + j) * z[i];
    tab_store(y + j, sum);
  }
  return status;
}
