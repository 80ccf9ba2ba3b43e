#include "controller/tab/tab_logit.h"

#include <cmath>

extern "C" TabStatus tab_logit_eval(const TabLogit* tab, const double* x, double* probability) {
  *probability = 0;
  const TabStatus status = tab_domain(&tab->head, x);
  if (status == kTabNotFinite) return status;
  const float* lo = tab_lo(&tab->head);
  const float* hi = tab_hi(&tab->head);
  double score = tab->bias;
  for (int32_t i = 0; i < tab->d; ++i) score += tab->weight[i] * std::fmin(std::fmax(x[i], double{lo[i]}), double{hi[i]});
  *probability = 1.0 / (1.0 + std::exp(-score));
  return status;
}
