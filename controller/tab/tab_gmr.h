/* Mixture regression: a mixture of Gaussians (GMR) or, from a Bayesian fit, of Student t distributions (BGMR) over inputs and outputs,
 * conditioned on the inputs. Several answers, each with its probability; or one, by moment matching.
 *
 *   p(y | x) = sum_k h_k(x) p_k(y | x),    y_k = mu_y + A (x - mu_x),    A = S_yx S_xx^-1,    q = |L^-1 (x - mu_x)|^2,   L L' = S_xx
 *
 *   Gaussian     log h_k ~ c_k - q / 2,                              var_k = diag(S_yy - A S_xy)
 *   Student t    log h_k ~ c_k - (nu + d) / 2  log(1 + q / nu),      var_k = (nu + q) / (nu + d - 2)  diag(S_yy - A S_xy)
 *
 * with c_k all that does not depend on x: weight, determinant, normalisation. Source: thesis, equations 2.13 to 2.18. */
#ifndef CONTROLLER_TAB_TAB_GMR_H_
#define CONTROLLER_TAB_TAB_GMR_H_

#include "controller/tab/tab.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { TAB_GMR_SCHEMA = 1 }; /* layout of TabGmr; a table of another schema is refused */
enum {
  TAB_GMR_MAX_K = 64,   /* most components */
  TAB_GMR_MAX_M = 256,  /* most outputs: with the above, bounds the scratch of a query (3 kB on the stack) */
};

typedef struct TabGmr {
  TabHead head;               /* arrays: lo hi log_norm freedom mean_x linv mean_y slope slope_scale var */
  int32_t k, d, m;            /* components, inputs, outputs */
  int32_t slope_type;         /* TabType */
  const float* log_norm;      /* (pad(k))        c_k */
  const float* freedom;       /* (pad(k))        nu; 0: Gaussian */
  const float* mean_x;        /* (k, pad(d)) */
  const float* linv;          /* (k, d, pad(d))  L^-1 by columns: row j holds what x_j adds to all entries */
  const float* mean_y;        /* (k, pad(m)) */
  const void* slope;          /* (k, d, pad(m))  A by columns, stored as slope_type */
  const float* slope_scale;   /* (pad(m)) */
  const float* var;           /* (k, pad(m))     diag(S_yy - A S_xy) */
} TabGmr;

/* The `count` most probable components, most probable first; among equals the lower index first.
 *
 *   index   (count)          out: component; -1 where the mixture has fewer than count, or the query is not finite
 *   weight  (count)          out: its probability given x; 0 where index is -1
 *   y       (count, pad(m))  out: its mean; zeros where index is -1
 *   var     (count, pad(m))  out: its variances; may be NULL
 *
 * k d pad(d) + count d pad(m) multiply-adds, k exponentials and logarithms. Reads 4 k d pad(d) + count d pad(m) (4, 2 or 1) bytes. */
TabStatus tab_gmr_modes(const TabGmr* tab, const double* x, int32_t count, int32_t* index, float* weight, float* y, float* var);

/* Mean (pad(m)) and variances (pad(m); may be NULL) of the whole mixture: moment matching. Averages modes; not for warm starts of a
 * multimodal problem. A query that is not finite: zeros. Operations of k modes. */
TabStatus tab_gmr_moments(const TabGmr* tab, const double* x, float* mean, float* var);

#ifdef __cplusplus
}
#endif
#endif /* CONTROLLER_TAB_TAB_GMR_H_ */
