// A plan: a trajectory with gains on absolute knot times, and what the loop asks of it.
#ifndef CONTROLLER_LOOP_LOOP_PLAN_H_
#define CONTROLLER_LOOP_LOOP_PLAN_H_

#include "controller/fddp/fddp.h"
#include "controller/rbd/rbd_rnea.h"

#include <cmath>
#include <cstring>

namespace engram {

// Knot k drives x[k] to x[k + 1] with u[k] from utime[k] to utime[k + 1] (us, the plant's clock). n = 0: no plan.
template <class P, int N> struct Plan {
  int n = 0;
  int64_t utime[N + 1];
  FddpSolution<P, N> s;

  double dt(int k) const { return 1e-6 * static_cast<double>(utime[k + 1] - utime[k]); }
  // The knot under way at time t, clamped to [0, n - 1].
  int knot_at(int64_t t) const {
    int k = 0;
    while (k + 1 < n && utime[k + 1] <= t) ++k;
    return k;
  }
};

// Knot times from `start` on: whole knots of `step` us whose ends lie on `phase` + m `step`; the first one is cut short.
template <int N> void knot_times(int64_t start, int64_t phase, int64_t step, int64_t (&utime)[N + 1]) {
  const int64_t since = ((start - phase) % step + step) % step;  // of the last grid point
  utime[0] = start;
  for (int k = 1; k <= N; ++k) utime[k] = start - since + k * step;
}

// State x (nx) on the plan at time t. Within a knot the acceleration is constant:
//   a = (v_{k+1} - v_k) / dt_k,   v = v_k + s a,   q = q_k (+) (s v_k + s^2/2 a),   s = t - utime[k]
// After the last knot the plan rests: q_n, v = 0.
template <class P, int N> void plan_state(const Plan<P, N>& plan, int64_t t, double* x) {
  constexpr int nq = P::nq, nv = P::nv;
  if (t == plan.utime[plan.n]) {
    std::memcpy(x, plan.s.x[plan.n], sizeof(plan.s.x[0]));
    return;
  }
  if (t > plan.utime[plan.n]) {
    std::memcpy(x, plan.s.x[plan.n], sizeof(double) * nq);
    std::memset(x + nq, 0, sizeof(double) * nv);
    return;
  }
  const int k = plan.knot_at(t);
  const double s = 1e-6 * static_cast<double>(t > plan.utime[0] ? t - plan.utime[k] : 0);
  const double *const v = plan.s.x[k] + nq, *const v_next = plan.s.x[k + 1] + nq;
  double dx[P::Layout::nxp] = {};
  for (int i = 0; i < nv; ++i) {
    const double a = (v_next[i] - v[i]) / plan.dt(k);
    dx[P::Layout::oq + i] = s * (v[i] + 0.5 * s * a);
    dx[P::Layout::ov + i] = s * a;
  }
  P::integrate(plan.s.x[k], dx, x);
}

// Torque that holds the posture q (nq) against gravity, for the driven dofs (nu).
template <class P> void gravity_torque(const double* q, double* u) {
  using R = typename P::R;
  RbdData<R, double> d;
  double g[R::nv];
  rbd_kinematics<R>(q, d);
  rbd_gravity<R>(d, g);
  for (int i = 0; i < P::nu; ++i) u[i] = g[P::nv - P::nu + i];
}

// A trajectory that need not be a motion yet: what seeds the solver.
template <class P, int N> struct Seed {
  double x[N + 1][P::nx];
  double u[N][P::nu];
};

// Torque that gives the acceleration a (nv) in the state x, for a fully driven robot.
template <class P> void inverse_dynamics(const double* x, const double* a, double* u) {
  using R = typename P::R;
  static_assert(P::nu == P::nv, "every dof is driven");
  RbdData<R, double> d;
  rbd_rnea<R>(x, x + P::nq, a, d, u);
}

// One knot further: comes to rest within a few knots, v' = v / 2, without a gap.
template <class P> void come_to_rest(double dt, const double* x, double* u, double* x_next) {
  double a[P::nv], dx[P::Layout::nxp] = {};
  for (int i = 0; i < P::nv; ++i) {
    const double v = x[P::nq + i], v_next = 0.5 * v;
    a[i] = (v_next - v) / dt;
    dx[P::Layout::oq + i] = dt * v_next;
    dx[P::Layout::ov + i] = v_next - v;
  }
  inverse_dynamics<P>(x, a, u);
  P::integrate(x, dx, x_next);
}

// The plan on other knot times, of which the first state is x0. Beyond its end, extend(k, x, u, x_next) gives control and next state.
template <class P, int N, class Extend>
void resample(const Plan<P, N>& plan, const int64_t (&utime)[N + 1], const double* x0, Seed<P, N>& seed, Extend extend) {
  std::memcpy(seed.x[0], x0, sizeof(seed.x[0]));
  for (int k = 0; k < N; ++k) {
    if (utime[k + 1] <= plan.utime[plan.n]) {
      std::memcpy(seed.u[k], plan.s.u[plan.knot_at(utime[k])], sizeof(seed.u[k]));
      plan_state(plan, utime[k + 1], seed.x[k + 1]);
    } else {
      extend(k, seed.x[k], seed.u[k], seed.x[k + 1]);
    }
  }
}

// The same, where beyond its end the plan comes to rest.
template <class P, int N>
void resample(const Plan<P, N>& plan, const int64_t (&utime)[N + 1], const double* x0, Seed<P, N>& seed) {
  resample(plan, utime, x0, seed, [&](int k, const double* x, double* u, double* x_next) {
    come_to_rest<P>(1e-6 * static_cast<double>(utime[k + 1] - utime[k]), x, u, x_next);
  });
}

// Stands still at the posture of x0 under gravity torque.
template <class P, int N> void stand_still(const double* x0, Seed<P, N>& seed) {
  double rest[P::nx] = {};
  std::memcpy(rest, x0, sizeof(double) * P::nq);
  for (int k = 0; k <= N; ++k) std::memcpy(seed.x[k], k == 0 ? x0 : rest, sizeof(seed.x[k]));
  gravity_torque<P>(x0, seed.u[0]);
  for (int k = 1; k < N; ++k) std::memcpy(seed.u[k], seed.u[0], sizeof(seed.u[k]));
}

// The plan as plain arrays (any may be null): times, states (n + 1 rows), controls, gains (n blocks, nu x ndx). Returns n.
template <class P, int N> int copy_plan(const Plan<P, N>& plan, int64_t* utime, double* x, double* u, double* K) {
  if (plan.n == 0) return 0;
  if (utime) std::memcpy(utime, plan.utime, sizeof(plan.utime));
  if (x) std::memcpy(x, plan.s.x, sizeof(plan.s.x));
  if (u) std::memcpy(u, plan.s.u, sizeof(plan.s.u));
  for (int k = 0; K && k < N; ++k)
    for (int i = 0; i < P::nu; ++i)
      for (int j = 0; j < P::ndx; ++j) *K++ = plan.s.K[k][i][padded_index<typename P::Layout>(j)];
  return plan.n;
}

// True if all n values are finite.
inline bool all_finite(const double* values, int n) {
  for (int i = 0; i < n; ++i)
    if (!std::isfinite(values[i])) return false;
  return true;
}

}  // namespace engram
#endif  // CONTROLLER_LOOP_LOOP_PLAN_H_
