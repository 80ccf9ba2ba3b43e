/* Tensor train: a density over d variables, sampled on a grid and stored as a product of cores,
 *   P(i_1, ..., i_d) = P^1[i_1] P^2[i_2] ... P^d[i_d],   P^k[i] an (r_k-1 x r_k) matrix, r_0 = r_d = 1,
 * that can be evaluated anywhere, conditioned on any subset of its variables, and sampled.
 * Source: thesis, section 7.3 and appendix B.1 (text lines 1513 to 1640, 2158). */
#ifndef CONTROLLER_TAB_TAB_TT_H_
#define CONTROLLER_TAB_TAB_TT_H_

#include "controller/tab/tab.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { TAB_TT_SCHEMA = 1 }; /* layout of TabTt; a table of another schema is refused */
enum {
  TAB_TT_MAX_D = 128, /* variables */
  TAB_TT_MAX_N = 512, /* points of a variable */
  TAB_TT_MAX_R = 64,  /* rank */
};

typedef struct TabTt {
  TabHead head;        /* arrays: lo hi shape scale core; point i of variable k is lo_k + i (hi_k - lo_k) / (n_k - 1) */
  int32_t d;           /* variables */
  int32_t type;        /* TabType of the cores */
  const float* shape;  /* (2 d + 1)  n_1 .. n_d, then r_0 .. r_d */
  const float* scale;  /* (d)        core k is scale_k times what is stored */
  const void* core;    /* core 1, ..., d: (n_k, r_k-1, tab_tt_width(r_k)), zeros beyond r_k */
} TabTt;

/* Numbers in a stored row of a core with r columns: whole vectors, but a single number where r = 1. */
static inline int32_t tab_tt_width(int32_t r) { return r == 1 ? 1 : tab_pad(r); }

/* The density at x (d), between grid points by linear interpolation of the cores (thesis B.1, B.2), and its gradient (d) unless NULL.
 * Outside the domain: the value at its border. Not finite: 0, gradient 0. Rows are rescaled by powers of two on the way, so that long
 * trains neither overflow nor vanish. Work: 2 sum r_k-1 r_k multiply-adds, twice that with the gradient; 36 kB of stack. */
TabStatus tab_tt_value(const TabTt* tab, const double* x, double* value, double* gradient);

/* A train over x, y, z [m] as a signed distance [m]: its value at the nearest point of its domain, plus the distance to that point; and
 * its gradient (3) [-] unless NULL. Not finite: 0, gradient 0. kTabBad if the train has not three variables. Fitted by
 * engram.learn.distance. */
TabStatus tab_tt_distance(const TabTt* tab, const double* p, float* distance, float* gradient);

/* Draws samples of the free variables given the fixed ones. All its memory is the caller's. */
typedef struct TabTtSampler {
  const TabTt* tab;
  int32_t capacity;               /* most samples of one call */
  bool fixed[TAB_TT_MAX_D];       /* what the samples are conditioned on */
  double x[TAB_TT_MAX_D];         /* (d) values of the fixed variables */
  float* marginal[TAB_TT_MAX_D];  /* W_k = P^k pi_k+1 (r_k-1, pad(n_k)), nothing fixed: pi_k the sum over all later variables */
  float* given[TAB_TT_MAX_D];     /* the same with the fixed variables at x, where that differs */
  bool use_given[TAB_TT_MAX_D];
  float* pi;                      /* (d + 1, TAB_TT_MAX_R) pi_k, nothing fixed */
  float *row, *row_next;          /* (capacity, TAB_TT_MAX_R) product of the cores so far */
  int32_t *order, *order_next;    /* (capacity) samples, those that agree so far side by side */
  int32_t *begin, *begin_next;    /* (capacity + 1) first of each such group in order */
  int32_t* point;                 /* (capacity) what the sample order[i] chose */
  int32_t *parent, *choice;       /* (capacity) of a new group: the group it came from, the point it chose */
  int32_t* alike;                 /* (capacity) new groups, those of the same choice side by side */
} TabTtSampler;

/* Bytes that tab_tt_init needs, aligned to 64. */
int64_t tab_tt_sampler_bytes(const TabTt* tab, int32_t capacity);

/* Prepares a sampler in `memory` and computes the marginals: sum n_k r_k-1 r_k multiply-adds. kTabBad if the memory is too small or the
 * capacity below 1. The table must have passed tab_check. */
TabStatus tab_tt_init(TabTtSampler* sampler, const TabTt* tab, int32_t capacity, void* memory, int64_t bytes);

/* Conditions on the variables whose `fixed` (d) is true, at their x (d); others' x is not read. All false: on nothing. Not finite: the
 * sampler stays as it is. Outside the domain: at its border. If the fixed variables come first, nothing is computed; otherwise the
 * marginals of the free variables before the last fixed one are: n_k r_k-1 r_k multiply-adds each. */
TabStatus tab_tt_condition(TabTtSampler* sampler, const double* x, const bool* fixed);

/* `count` samples of the conditional distribution with priority alpha, each variable given those before it (thesis, algorithm 6):
 *   p_k(i) ~ |row_k W_k[i]|^(1 / (1 - alpha)),   row_k+1 = row_k P^k[i_k].
 * alpha = 0: the distribution itself; alpha >= 1: the largest point of each p_k. Where all p_k vanish: uniform.
 *
 *   x         (count, d)  out: grid points; fixed variables as given
 *   log_prob  (count)     out unless NULL: logarithm of the probability with which the sample's points were drawn
 *
 * Sample s depends on the seed and s alone. Samples that agree in their first variables share the work: at most count sum r_k-1 (n_k +
 * r_k) multiply-adds, and count sum n_k powers. Variables outermost, so that every core is read once. kTabBad if count is not in 1 ..
 * capacity or alpha is not a number. */
TabStatus tab_tt_sample(TabTtSampler* sampler, double alpha, int32_t count, uint64_t seed, double* x, double* log_prob);

/* Indices of the k lowest of n costs, lowest first; NaN is worse than anything; -1 where there are fewer. */
void tab_lowest(const double* cost, int32_t n, int32_t k, int32_t* index);

#ifdef __cplusplus
}
#endif
#endif /* CONTROLLER_TAB_TAB_TT_H_ */
