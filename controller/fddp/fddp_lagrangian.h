// Constraints lo <= r(x_k) <= hi on chosen knots by augmented Lagrangian: FDDP inside, multipliers outside.
//
// A constraint is a term of the problem, ResidualTerm<F, Lagrangian> or, of a contact's force, ConeLimit<FrictionConeTerm<c>>, whose parameters of a knot hold penalty w, bounds and multiplier
// lambda. With Pi the projection on [lo, hi], a round solves the problem with the terms' costs 1/2 w |r + lambda/w - Pi(r + lambda/w)|^2
// and then sets
//   lambda <- w (s - Pi(s)),  s = r + lambda/w
// The measure |r - Pi(s)| of a row vanishes where the constraint holds and its multiplier is complementary; while the largest one does not
// shrink well, penalties grow. Equalities (lo = hi) and inequalities are one case.
// Source: Nocedal & Wright, Numerical Optimization (2006), framework 17.3 and equations 17.65-17.67.
//
// Multipliers and penalties live in the horizon's knots: they survive, shift with the knots, and start the next solve.
#ifndef CONTROLLER_FDDP_FDDP_LAGRANGIAN_H_
#define CONTROLLER_FDDP_FDDP_LAGRANGIAN_H_

#include "controller/fddp/fddp_solve.h"

#include <cmath>

namespace engram {

struct LagrangianOpts {
  int rounds = 30;             // at most
  double tolerance = 1e-4;     // on the largest measure, in units of the residuals
  double shrink = 0.25;        // penalties grow unless a round leaves at most this share of the measure
  double penalty_factor = 10.0;
  double penalty_max = 1e9;
};

struct LagrangianStats {
  int rounds = 0;
  int iterations = 0;      // of FDDP, over all rounds
  double violation = 0.0;  // largest |r - Pi(r)|
  double measure = 0.0;    // largest |r - Pi(s)|
};

// Calls f(i, parameters, residual) for every row that holds a constraint: penalty > 0.
template <class P, int N, class F> void for_constraints(Horizon<P, N>& h, const FddpSolution<P, N>& s, F f) {
  const Real none[P::nu] = {};
  const auto rows = [&](auto& p, const auto& r) {
    for (int i = 0; i < int(sizeof(r) / sizeof(r[0])); ++i)
      if (p.w[i] > 0.0) f(i, p, r[i]);
  };
  for (int k = 0; k <= h.n; ++k) {
    const Real* const u = k < h.n ? s.u[k] : none;
    if constexpr (P::kPhases) P::visit_constraints(h.phase_of(k), h.knot[k], s.x[k], u, rows);
    else P::visit_constraints(h.knot[k], s.x[k], u, rows);
  }
}

// Multipliers of the trajectory in s; fills stats.violation and stats.measure.
template <class P, int N> void lagrangian_multipliers(Horizon<P, N>& h, const FddpSolution<P, N>& s, LagrangianStats& stats) {
  stats.violation = stats.measure = 0.0;
  for_constraints(h, s, [&](int i, auto& p, double r) {
    const auto beyond = [&](double a) { return std::fmax(a - p.hi[i], 0.0) + std::fmin(a - p.lo[i], 0.0); };  // a - Pi(a)
    const double e = beyond(r + p.lambda[i] / p.w[i]);
    stats.violation = std::fmax(stats.violation, std::fabs(beyond(r)));
    stats.measure = std::fmax(stats.measure, std::fabs(e - p.lambda[i] / p.w[i]));
    p.lambda[i] = p.w[i] * e;
  });
}

// From the guess in s and the multipliers in h to a constrained optimum. Converged: FDDP has, and the measure is within its tolerance.
// kIterationLimit: rounds are spent; s and h hold the last iterate. Other endings are FDDP's.
template <class P, int N>
FddpStatus fddp_lagrangian(Horizon<P, N>& h, const LagrangianOpts& outer, const FddpOpts& opts, FddpWork<P, N>& w, FddpSolution<P, N>& s,
                           FddpStats& inner, LagrangianStats& stats) {
  stats = LagrangianStats{};
  double before = INFINITY;
  while (stats.rounds < outer.rounds) {
    const FddpStatus status = fddp_solve(h, opts, w, s, inner);
    ++stats.rounds;
    stats.iterations += inner.iterations;
    if (status != FddpStatus::kConverged && status != FddpStatus::kIterationLimit) return status;
    lagrangian_multipliers(h, s, stats);
    if (status == FddpStatus::kConverged && stats.measure <= outer.tolerance) return status;
    if (stats.measure > outer.shrink * before)
      for_constraints(h, s, [&](int i, auto& p, double) { p.w[i] = std::fmin(p.w[i] * outer.penalty_factor, outer.penalty_max); });
    before = stats.measure;
  }
  return inner.status = FddpStatus::kIterationLimit;
}

}  // namespace engram
#endif  // CONTROLLER_FDDP_FDDP_LAGRANGIAN_H_
