/* k-NN: the K remembered samples nearest to a query, by weighted squared distance. Exact, with deterministic ties. */
#ifndef CONTROLLER_TAB_TAB_KNN_H_
#define CONTROLLER_TAB_TAB_KNN_H_

#include "controller/tab/tab.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { TAB_KNN_SCHEMA = 1 }; /* layout of TabKnn; a table of another schema is refused */

typedef struct TabKnn {
  TabHead head;        /* arrays: lo hi scale x value */
  int32_t n, d, m;     /* samples, inputs, numbers remembered with a sample */
  const float* scale;  /* (d)                         weight of an input: distance^2 = sum_i (scale_i (x_i - y_i))^2 */
  const float* x;      /* (pad(n)/8, d, 8)            scaled inputs of sample 8 b + lane; padding samples: TAB_FAR */
  const float* value;  /* (n, pad(m))                 what sample i remembers */
} TabKnn;

/* The k nearest samples, nearest first; among equals the lower index first.
 *
 *   x          (d)  query, in the units of the head
 *   index      (k)  out: samples; -1 where the table holds fewer than k, or the query is not finite
 *   distance2  (k)  out: squared distances, in scaled units; INFINITY where index is -1
 *
 * Accumulates in float: relative error of a distance below (d + 2) 2^-24. n d multiply-adds, 4 n d bytes read. */
TabStatus tab_knn_query(const TabKnn* tab, const double* x, int32_t k, int32_t* index, float* distance2);

/* What sample i remembers: m floats. */
static inline const float* tab_knn_value(const TabKnn* tab, int32_t i) { return tab->value + (int64_t)i * tab_pad(tab->m); }

#ifdef __cplusplus
}
#endif
#endif /* CONTROLLER_TAB_TAB_KNN_H_ */
