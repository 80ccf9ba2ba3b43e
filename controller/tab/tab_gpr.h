/* Gaussian process regression: ARD squared-exponential kernel shared by all outputs, mean and variance.
 *
 *   k(x, y) = s exp(-1/2 sum_i ((x_i - y_i) / l_i)^2),   mean = y0 + k(x, X) alpha,   var = s + noise - |Linv k(X, x)|^2
 *
 * with L L' = K(X, X) + noise I. Source: Rasmussen, Williams, Gaussian Processes for Machine Learning (2006), algorithm 2.1. */
#ifndef CONTROLLER_TAB_TAB_GPR_H_
#define CONTROLLER_TAB_TAB_GPR_H_

#include "controller/tab/tab.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { TAB_GPR_SCHEMA = 1 }; /* layout of TabGpr; a table of another schema is refused */
enum { TAB_GPR_MAX_N = 1024 }; /* most samples: bounds the scratch of a query (4 kB on the stack) */

typedef struct TabGpr {
  TabHead head;             /* arrays: lo hi inv_length x alpha mean linv */
  int32_t n, d, m;          /* samples, inputs, outputs */
  float variance, noise;    /* s, noise: in units of the (normalised) outputs, squared */
  const float* inv_length;  /* (d)               1 / l_i */
  const float* x;           /* (pad(n)/8, d, 8)  x_i / l_i of sample 8 b + lane; padding samples: TAB_FAR */
  const float* alpha;       /* (n, pad(m)) */
  const float* mean;        /* (pad(m))          y0 */
  const float* linv;        /* rows 0..n-1 of the lower triangle of L^-1, row i padded to pad(i + 1); NULL: no variance */
} TabGpr;

/* Mean (m floats, room for pad(m)) and, where var is not NULL, the variance (one float: the same for all outputs, relative to their
 * normalisation; of a table without linv the prior's). A query that is not finite gives the prior: mean y0 and variance s + noise.
 * n (d + m) multiply-adds and n exponentials; the variance adds n^2 / 2. */
TabStatus tab_gpr_query(const TabGpr* tab, const double* x, float* mean, float* var);

/* Floats in linv. */
static inline int64_t tab_gpr_linv_size(int32_t n) {
  int64_t size = 0;
  for (int32_t i = 0; i < n; ++i) size += tab_pad(i + 1);
  return size;
}

#ifdef __cplusplus
}
#endif
#endif /* CONTROLLER_TAB_TAB_GPR_H_ */
