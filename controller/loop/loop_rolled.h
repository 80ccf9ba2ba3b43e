// What trajectories cost once their gaps are closed: kLanes of them rolled out side by side, each with its own gains.
//
//   J = sum_k l_k(x_k, u_k) + l_N(x_N),   u_k = us_k - K_k (x_k (-) xs_k) within the torque limits,   x_{k+1} = f(x_k, u_k)
#ifndef CONTROLLER_LOOP_LOOP_ROLLED_H_
#define CONTROLLER_LOOP_LOOP_ROLLED_H_

#include "controller/fddp/fddp.h"

namespace engram {

// From h.x0, for two trajectories of a problem with phases. One that does not stay finite costs +infinity or NaN.
template <class P, int N> void loop_rolled(const Horizon<P, N>& h, const FddpSolution<P, N>& a, const FddpSolution<P, N>& b, double (&cost)[2]) {
  using L = typename P::Layout;
  typename P::template Knot<Pack> knot;
  constexpr int knot_size = sizeof(knot) / sizeof(Pack);
  const auto both = [](double of_a, double of_b) {
    Pack p = of_b;
    p.l[0] = of_a;
    return p;
  };
  Pack x[P::nx], next[P::nx], at[P::nx], u[P::nu], dx[L::nxp], cost_k, sum = 0.0;
  for (int i = 0; i < P::nx; ++i) x[i] = h.x0[i];
  for (int k = 0; k <= h.n; ++k) {
    const double* const p = reinterpret_cast<const double*>(&h.knot[k]);
    for (int e = 0; e < knot_size; ++e) reinterpret_cast<Pack*>(&knot)[e] = p[e];
    if (k == h.n) {
      P::calc_terminal(knot, x, cost_k);
    } else {
      for (int i = 0; i < P::nx; ++i) at[i] = both(a.x[k][i], b.x[k][i]);
      P::difference(at, x, dx);
      for (int i = 0; i < P::nu; ++i) {
        u[i] = both(a.u[k][i], b.u[k][i]);
        for (int j = 0; j < L::nxp; ++j) u[i] -= both(a.K[k][i][j], b.K[k][i][j]) * dx[j];
        u[i] = min(max(u[i], Pack(P::u_lo(i))), Pack(P::u_hi(i)));
      }
      P::calc(h.phase[k], knot, x, u, next, cost_k);
      for (int i = 0; i < P::nx; ++i) x[i] = next[i];
    }
    sum += cost_k;
  }
  for (int i = 0; i < 2; ++i) cost[i] = sum.l[i];
}

}  // namespace engram
#endif  // CONTROLLER_LOOP_LOOP_ROLLED_H_
