#include "controller/tab/tab_eval.h"

#include "controller/tab/tab_gmr.h"
#include "controller/tab/tab_gpr.h"
#include "controller/tab/tab_knn.h"
#include "controller/tab/tab_logit.h"
#include "controller/tab/tab_mlp.h"
#include "controller/tab/tab_pca.h"
#include "controller/tab/tab_sdf.h"
#include "controller/tab/tab_tt.h"

#include <cmath>
#include <cstring>

namespace {

template <class Tab> const Tab* as(const TabHead* head) { return reinterpret_cast<const Tab*>(head); }

TabStatus neighbours(const TabKnn* tab, const double* x, int32_t count, int32_t* index, float* weight, float* y) {
  float distance2[TAB_MAX_ANSWERS];
  const TabStatus status = tab_knn_query(tab, x, count, index, distance2);
  const int32_t found = status == kTabNotFinite ? 0 : count < tab->n ? count : tab->n;
  for (int32_t i = 0; i < found; ++i) {
    weight[i] = 1.0f / static_cast<float>(found);
    std::memcpy(y + static_cast<int64_t>(i) * tab_pad(tab->m), tab_knn_value(tab, index[i]), sizeof(float) * tab_pad(tab->m));
  }
  return status;
}

// Kinds with one answer.
TabStatus single(const TabHead* head, const double* x, float* y, float* var) {
  switch (head->kind) {
    case kTabGpr: {
      float variance;
      const TabStatus status = tab_gpr_query(as<TabGpr>(head), x, y, var ? &variance : nullptr);
      for (int32_t j = 0; var && j < head->nout; ++j) var[j] = variance;
      return status;
    }
    case kTabPca: {
      float z[TAB_MAX_IN];
      for (int32_t i = 0; i < head->nin; ++i) z[i] = static_cast<float>(x[i]);
      return tab_pca_decode(as<TabPca>(head), z, y);
    }
    case kTabLogit: {
      double probability;
      const TabStatus status = tab_logit_eval(as<TabLogit>(head), x, &probability);
      y[0] = static_cast<float>(probability);
      return status;
    }
    case kTabSdf: return tab_sdf_eval(as<TabSdf>(head), x, y, nullptr);
    case kTabTt: {
      double value;
      const TabStatus status = tab_tt_value(as<TabTt>(head), x, &value, nullptr);
      y[0] = static_cast<float>(value);
      return status;
    }
    default: return kTabBad;
  }
}

}  // namespace

extern "C" {

TabStatus tab_answers(const TabHead* head, const double* x, int32_t count, int32_t* index, float* weight, float* y, float* var) {
  const int64_t m_pad = tab_pad(head->nout);
  if (count > TAB_MAX_ANSWERS) count = TAB_MAX_ANSWERS;
  if (count < 1) return tab_domain(head, x);
  switch (head->kind) {
    case kTabGmr: return tab_gmr_modes(as<TabGmr>(head), x, count, index, weight, y, var);
    case kTabMlp: return tab_mlp_modes(as<TabMlp>(head), x, count, index, weight, y, var);
    default: break;
  }
  for (int32_t i = 0; i < count; ++i) {
    index[i] = -1;
    weight[i] = 0;
  }
  std::memset(y, 0, sizeof(float) * count * m_pad);
  for (int64_t i = 0; var && i < count * m_pad; ++i) var[i] = INFINITY;
  if (head->kind == kTabKnn) return neighbours(as<TabKnn>(head), x, count, index, weight, y);
  const TabStatus status = single(head, x, y, var);
  if (status < kTabNotFinite) {
    index[0] = 0;
    weight[0] = 1;
  }
  return status;
}

TabStatus tab_eval(const TabHead* head, const double* x, float* y, float* var) {
  int32_t index;
  float weight;
  return tab_answers(head, x, 1, &index, &weight, y, var);
}

}  // extern "C"
