/* One call for every kind of table: x in, one answer or several out. What a kind calls an answer:
 *
 *   k-NN     what a near sample remembers, nearest first, all alike probable      variances: unknown
 *   GPR      the mean of the process                                              its variance, the same for all outputs
 *   GMR      the means of the most probable components                            theirs
 *   MLP      the answers of all members, all alike probable; with a mixture       theirs; without a head unknown
 *            density head the most probable of all modes
 *   PCA      the decoded numbers      logit   the probability                     unknown
 *   SDF      the distance             TT      the density                         unknown
 *
 * An RBF table decodes weights, it does not answer: kTabBad, like a kind that is not known. Unknown variances are infinite. */
#ifndef CONTROLLER_TAB_TAB_EVAL_H_
#define CONTROLLER_TAB_TAB_EVAL_H_

#include "controller/tab/tab.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { TAB_MAX_ANSWERS = 64 }; /* most answers of a query */

/* The `count` (at most TAB_MAX_ANSWERS) best answers to x (nin), best first.
 *
 *   index   (count)             out: sample, component, mode; -1 where there are no more, or the query is not finite
 *   weight  (count)             out: its probability; 0 where index is -1
 *   y       (count, pad(nout))  out: the answer; zeros where index is -1
 *   var     (count, pad(nout))  out: its variances; may be NULL */
TabStatus tab_answers(const TabHead* head, const double* x, int32_t count, int32_t* index, float* weight, float* y, float* var);

/* The best answer alone: y (pad(nout)), var (pad(nout); may be NULL). */
TabStatus tab_eval(const TabHead* head, const double* x, float* y, float* var);

#ifdef __cplusplus
}
#endif
#endif /* CONTROLLER_TAB_TAB_EVAL_H_ */
