/* Logistic regression: the probability p = 1 / (1 + exp(-(bias + weight . x))) that what x describes is good. */
#ifndef CONTROLLER_TAB_TAB_LOGIT_H_
#define CONTROLLER_TAB_TAB_LOGIT_H_

#include "controller/tab/tab.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { TAB_LOGIT_SCHEMA = 1 }; /* layout of TabLogit; a table of another schema is refused */

typedef struct TabLogit {
  TabHead head;         /* arrays: lo hi weight */
  int32_t d;            /* inputs */
  float bias;
  const float* weight;  /* (d) per unit of the input */
} TabLogit;

/* Probability in [0, 1]; inputs are clamped to the domain first (a calibration does not extrapolate). Not finite: 0. */
TabStatus tab_logit_eval(const TabLogit* tab, const double* x, double* probability);

#ifdef __cplusplus
}
#endif
#endif /* CONTROLLER_TAB_TAB_LOGIT_H_ */
