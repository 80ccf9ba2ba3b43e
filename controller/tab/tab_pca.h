/* PCA decoder: y = mean + basis' z. */
#ifndef CONTROLLER_TAB_TAB_PCA_H_
#define CONTROLLER_TAB_TAB_PCA_H_

#include "controller/tab/tab.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { TAB_PCA_SCHEMA = 1 }; /* layout of TabPca; a table of another schema is refused */

typedef struct TabPca {
  TabHead head;        /* arrays: lo hi mean basis */
  int32_t m, n;        /* components, decoded numbers */
  const float* mean;   /* (pad(n)) */
  const float* basis;  /* (m, pad(n))  row i: component i times the scale of its coefficient */
} TabPca;

/* y (room for pad(n)) from the coefficients z (m). Not finite: y = mean. m n multiply-adds. */
TabStatus tab_pca_decode(const TabPca* tab, const float* z, float* y);

#ifdef __cplusplus
}
#endif
#endif /* CONTROLLER_TAB_TAB_PCA_H_ */
