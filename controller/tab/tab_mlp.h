/* Networks: fully connected, ReLU between the layers, linear at the end; an ensemble of members of one shape; and as a last layer, where
 * asked for, the head of a mixture density network: several answers, each with its probability.
 *
 *   z_0 = (x - center) / width,   z_l = max(0, b_l + W_l' z_l-1),   out = b + W' z
 *
 *   modes = 0    out (m): the answer. A task and noise as inputs and one member per query: the generator of a GAN (thesis, chapter 6)
 *   modes = K    out (K + 2 K m): logits, means, log standard deviations of K Gaussians (thesis, section 8.3) */
#ifndef CONTROLLER_TAB_TAB_MLP_H_
#define CONTROLLER_TAB_TAB_MLP_H_

#include "controller/tab/tab.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { TAB_MLP_SCHEMA = 1 }; /* layout of TabMlp; a table of another schema is refused */
enum {
  TAB_MLP_MAX_WIDTH = 512, /* widest layer: bounds the scratch of a query (7 kB on the stack) */
  TAB_MLP_MAX_DEPTH = 8,   /* most hidden layers */
  TAB_MLP_MAX_PARTS = 64,  /* most members times modes */
};

typedef struct TabMlp {
  TabHead head;              /* arrays: lo hi center inv_width weight weight_scale bias */
  int32_t d, m;              /* inputs, outputs */
  int32_t depth, hidden;     /* hidden layers and their width */
  int32_t members, modes;    /* networks; Gaussians of the head, 0: none */
  int32_t weight_type;       /* TabType */
  const float* center;       /* (d) */
  const float* inv_width;    /* (d) */
  const void* weight;        /* members, layers: (inputs, pad(outputs)), stored as weight_type */
  const float* weight_scale; /* members, layers: (pad(outputs)) */
  const float* bias;         /* members, layers: (pad(outputs)) */
} TabMlp;

/* Numbers that leave the last layer. */
static inline int32_t tab_mlp_width_out(const TabMlp* tab) { return tab->modes > 0 ? tab->modes * (1 + 2 * tab->m) : tab->m; }

/* What leaves the last layer of one member: out (pad(tab_mlp_width_out)). A query that is not finite: zeros.
 * (depth - 1) hidden^2 + hidden (d + outputs) multiply-adds, as many weights of 4, 2 or 1 bytes read. */
TabStatus tab_mlp_eval(const TabMlp* tab, int32_t member, const double* x, float* out);

/* Mean (pad(m)) of the members and of their modes, and variances (pad(m); may be NULL): moment matching.
 * Operations of every member. */
TabStatus tab_mlp_moments(const TabMlp* tab, const double* x, float* mean, float* var);

/* The `count` most probable answers of all members, most probable first; among equals the lower index first. Members count alike.
 *
 *   index   (count)          out: member * max(1, modes) + mode; -1 where there are fewer, or the query is not finite
 *   weight  (count)          out: its probability; 0 where index is -1
 *   y       (count, pad(m))  out: its mean; zeros where index is -1
 *   var     (count, pad(m))  out: its variances, infinite without a head; may be NULL
 *
 * Operations of every member once; answers among the `count` best so far are moved when a better one comes. */
TabStatus tab_mlp_modes(const TabMlp* tab, const double* x, int32_t count, int32_t* index, float* weight, float* y, float* var);

/* Numbers in weight, weight_scale and bias. */
static inline int64_t tab_mlp_weights(const TabMlp* tab) {
  const int64_t hidden = tab_pad(tab->hidden), out = tab_pad(tab_mlp_width_out(tab));
  return tab->members * (tab->d * hidden + (tab->depth - 1) * tab->hidden * hidden + tab->hidden * out);
}
static inline int64_t tab_mlp_biases(const TabMlp* tab) {
  return (int64_t)tab->members * (tab->depth * tab_pad(tab->hidden) + tab_pad(tab_mlp_width_out(tab)));
}

#ifdef __cplusplus
}
#endif
#endif /* CONTROLLER_TAB_TAB_MLP_H_ */
