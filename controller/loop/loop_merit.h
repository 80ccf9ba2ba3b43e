// The merit by which guesses are compared: cost + weight * L1 norm of the gaps, kLanes guesses side by side.
#ifndef CONTROLLER_LOOP_LOOP_MERIT_H_
#define CONTROLLER_LOOP_LOOP_MERIT_H_

#include "controller/engram.h"
#include "controller/fddp/fddp.h"

namespace engram {

inline constexpr double kMeritWeight = 10.0;  // per unit of gap: rad, m, rad/s, m/s

// A trajectory somebody proposes: N + 1 states and N controls, owned by the proposer.
template <class P> struct Candidate {
  engram_candidate kind;
  const double (*x)[P::nx];
  const double (*u)[P::nu];
  double trust;  // [0, 1] of the memory; 0 for others
  double merit, cost;
};

// What is asked of a memory beside the target.
struct Question {
  bool remember;      // false: the straight lines alone
  int64_t elsewhere;  // not 0: one of the lines ends elsewhere, and the draws differ
  engram_clock clock; // may be NULL
  double* us;         // (ENGRAM_CANDIDATE_COUNT) out: what the guesses of each kind took, by the clock
};

// Fills merit and cost of n candidates on the horizon h. A trajectory that is not finite gets the merit +infinity.
template <class P, int N> void loop_merit(const Horizon<P, N>& h, Candidate<P>* candidates, int n) {
  using L = typename P::Layout;
  typename P::template Knot<Pack> knot;
  constexpr int knot_size = sizeof(knot) / sizeof(Pack);
  for (int first = 0; first < n; first += kLanes) {
    const Candidate<P>* c[kLanes];
    for (int l = 0; l < kLanes; ++l) c[l] = &candidates[first + l < n ? first + l : n - 1];
    Pack x[P::nx], x_next[P::nx], u[P::nu] = {}, f[L::nxp], cost_k, cost = 0.0, gap = 0.0;
    for (int i = 0; i < P::nx; ++i) x_next[i] = h.x0[i];
    for (int k = 0; k <= h.n; ++k) {
      for (int i = 0; i < P::nx; ++i)
        for (int l = 0; l < kLanes; ++l) x[i].l[l] = c[l]->x[k][i];
      P::difference(x, x_next, f);
      for (int e = 0; e < L::nxp; ++e) gap += abs(f[e]);
      const double* const p = reinterpret_cast<const double*>(&h.knot[k]);
      for (int e = 0; e < knot_size; ++e) reinterpret_cast<Pack*>(&knot)[e] = p[e];
      if (k < h.n) {
        for (int i = 0; i < P::nu; ++i)
          for (int l = 0; l < kLanes; ++l) u[i].l[l] = c[l]->u[k][i];
        if constexpr (P::kPhases) P::calc(h.phase[k], knot, x, u, x_next, cost_k);
        else P::calc(knot, x, u, x_next, cost_k);
      } else {
        P::calc_terminal(knot, x, cost_k);
      }
      cost += cost_k;
    }
    const Pack merit = cost + Pack(kMeritWeight) * gap;
    for (int l = 0; l < kLanes && first + l < n; ++l) {
      candidates[first + l].merit = std::isfinite(merit.l[l]) ? merit.l[l] : HUGE_VAL;
      candidates[first + l].cost = cost.l[l];
    }
  }
}

}  // namespace engram
#endif  // CONTROLLER_LOOP_LOOP_MERIT_H_
