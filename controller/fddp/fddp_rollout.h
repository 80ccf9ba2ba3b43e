// Step 3 of an iteration: roll out kLanes step lengths at once, each in its lane.
//
//   x^_0 = x0 (+) (alpha - 1) f_0,   u^_k = u_k - alpha k_k - K_k (x^_k (-) x_k),   x^_{k+1} = f(x^_k, u^_k) (+) (alpha - 1) f_{k+1}
#ifndef CONTROLLER_FDDP_FDDP_ROLLOUT_H_
#define CONTROLLER_FDDP_FDDP_ROLLOUT_H_

#include "controller/fddp/fddp_linearize.h"

namespace engram {

// Rolls the step lengths alpha (a lane each) into w.x_try, w.u_try; returns their costs and in dv the rollout's share of the
// expected improvement, dv = sum_k f_k' Vxx_k (x^_k (-) x_k).
template <class P, int N>
Pack fddp_rollout(const Horizon<P, N>& h, const FddpOpts& opts, const FddpSolution<P, N>& s, Pack alpha, FddpWork<P, N>& w, Pack& dv) {
  using L = typename P::Layout;
  typename P::template Knot<Pack> knot;
  constexpr int knot_size = sizeof(knot) / sizeof(Pack);
  Pack x_next[P::nx], x[P::nx], dx[L::nxp], open[L::nxp], cost_k, cost = 0.0;
  Pack no_control[P::nu];
  for (int i = 0; i < P::nu; ++i) no_control[i] = 0.0;
  for (int i = 0; i < P::nx; ++i) x_next[i] = h.x0[i];
  dv = 0.0;
  for (int k = 0; k <= h.n; ++k) {
    if (w.feasible) {
      for (int i = 0; i < P::nx; ++i) w.x_try[k][i] = x_next[i];
    } else {
      for (int i = 0; i < L::nxp; ++i) open[i] = (alpha - Pack(1.0)) * Pack(w.f[k][i]);
      P::integrate(x_next, open, w.x_try[k]);
    }
    for (int i = 0; i < P::nx; ++i) x[i] = s.x[k][i];
    P::difference(x, w.x_try[k], dx);
    if (!w.feasible)
      for (int i = 0; i < L::nxp; ++i) dv += Pack(w.Vf[k][i]) * dx[i];

    const Real* const p = reinterpret_cast<const Real*>(&h.knot[k]);
    for (int e = 0; e < knot_size; ++e) reinterpret_cast<Pack*>(&knot)[e] = p[e];
    if (k < h.n) {
      for (int i = 0; i < P::nu; ++i) {
        Pack Kdx = 0.0;
        for (int j = 0; j < L::ndx; ++j) Kdx += Pack(s.K[k][i][padded_index<L>(j)]) * dx[padded_index<L>(j)];
        w.u_try[k][i] = Pack(s.u[k][i]) - alpha * Pack(w.k[k][i]) - Kdx;
        if (opts.box) w.u_try[k][i] = min(max(w.u_try[k][i], Pack(P::u_lo(i))), Pack(P::u_hi(i)));
      }
      if constexpr (P::kPhases) P::calc(h.phase[k], knot, w.x_try[k], w.u_try[k], x_next, cost_k);
      else P::calc(knot, w.x_try[k], w.u_try[k], x_next, cost_k);
    } else {
      P::calc_terminal(knot, w.x_try[k], cost_k);
    }
    cost += cost_k;
  }
  return cost;
}

// Makes a lane of the last rollout the trajectory.
template <class P, int N> void fddp_accept(const Horizon<P, N>& h, const FddpWork<P, N>& w, int lane, FddpSolution<P, N>& s) {
  for (int k = 0; k <= h.n; ++k)
    for (int i = 0; i < P::nx; ++i) s.x[k][i] = w.x_try[k][i].l[lane];
  for (int k = 0; k < h.n; ++k)
    for (int i = 0; i < P::nu; ++i) s.u[k][i] = w.u_try[k][i].l[lane];
}

}  // namespace engram
#endif  // CONTROLLER_FDDP_FDDP_ROLLOUT_H_
