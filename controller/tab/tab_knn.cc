#include "controller/tab/tab_knn.h"

#include "controller/tab/tab_lanes.h"

#include <cmath>

using namespace engram;

extern "C" TabStatus tab_knn_query(const TabKnn* tab, const double* x, int32_t k, int32_t* index, float* distance2) {
  for (int32_t i = 0; i < k; ++i) {
    index[i] = -1;
    distance2[i] = INFINITY;
  }
  const TabStatus status = tab_domain(&tab->head, x);
  if (status == kTabNotFinite || k < 1) return status;

  float query[TAB_MAX_IN];
  for (int32_t i = 0; i < tab->d; ++i) {
    // a huge but finite input must not overflow when squared: it is outside the domain anyway
    query[i] = std::fmin(std::fmax(static_cast<float>(x[i]) * tab->scale[i], -TAB_FAR), TAB_FAR);
  }

  const int32_t block_size = tab->d * TAB_LANES;
  const float* block = tab->x;
  for (int32_t first = 0; first < tab->n; first += TAB_LANES, block += block_size) {
    const TabLanes near2 = tab_block_distance2(block, query, tab->d);
    for (int32_t lane = 0; lane < TAB_LANES; ++lane) {
      const float d2 = near2[lane];
      if (!(d2 < distance2[k - 1]) || first + lane >= tab->n) continue;
      // insertion into the sorted list; strict, so that among equals the earlier sample stays ahead
      int32_t at = k - 1;
      for (; at > 0 && d2 < distance2[at - 1]; --at) {
        distance2[at] = distance2[at - 1];
        index[at] = index[at - 1];
      }
      distance2[at] = d2;
      index[at] = first + lane;
    }
  }
  return status;
}
