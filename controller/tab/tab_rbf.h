/* Trajectories as weights of normalised Gaussians over time, evaluated at any time:
 *
 *   y(t) = sum_k phi_k(t) w_k,   phi_k = g_k / sum_j g_j,   g_k = exp(-1/2 ((t - c_k) / h)^2)
 *
 * Normalised, so that a constant is represented exactly. */
#ifndef CONTROLLER_TAB_TAB_RBF_H_
#define CONTROLLER_TAB_TAB_RBF_H_

#include "controller/tab/tab.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { TAB_RBF_SCHEMA = 1 }; /* layout of TabRbf; a table of another schema is refused */
enum { TAB_RBF_MAX_K = 64 }; /* most Gaussians */

typedef struct TabRbf {
  TabHead head;         /* arrays: lo hi center; the input is the time */
  int32_t k, nchannel;  /* Gaussians, channels of a trajectory */
  float width;          /* h [s] */
  const float* center;  /* (pad(k)) c_k [s] */
} TabRbf;

/* Basis at nt times t [s]: phi and, where not NULL, its time derivative dphi [1/s], both (nt, k). A time outside [lo, hi] is taken at
 * the nearer end, with dphi = 0 there; a time that is not finite gives zeros. nt k exponentials. */
TabStatus tab_rbf_basis(const TabRbf* tab, int32_t nt, const double* t, double* phi, double* dphi);

/* y = phi w: the channels [first, first + count) of a trajectory at nt times, y (nt, count), from the weights w (k, nchannel).
 * With dphi in place of phi: its time derivative. nt k count multiply-adds, in double. */
void tab_rbf_eval(const TabRbf* tab, const float* w, int32_t first, int32_t count, int32_t nt, const double* phi, double* y);

#ifdef __cplusplus
}
#endif
#endif /* CONTROLLER_TAB_TAB_RBF_H_ */
