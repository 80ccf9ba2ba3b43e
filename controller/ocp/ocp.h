// A knot of the optimal control problem: a robot R, driven by its controls (ocp_actuation.h), and a sum of cost terms.
//
//   a  = forward dynamics (q, v, u)
//   v' = v + dt a                      semi-implicit Euler on the manifold
//   q' = q (+) dt v'
//   l  = sum of the terms' costs       (their weights carry the factor dt)
//
// A term is a struct with Param<S> (its parameters of one knot, scalars only), cost() and expand(), the latter adding its gradient
// and Gauss-Newton Hessian. The parameters of a knot are the sum of the terms' parameters, so that kLanes knots gather as one array.
#ifndef CONTROLLER_OCP_OCP_H_
#define CONTROLLER_OCP_OCP_H_

#include "controller/ocp/ocp_actuation.h"
#include "controller/ocp/ocp_residual.h"
#include "controller/rbd/rbd_derivatives.h"
#include "controller/rbd/rbd_forward.h"
#include "controller/rbd/rbd_manifold.h"

#include <cstring>

namespace engram {

template <class R_, class... Terms> struct Ocp {
  using R = R_;
  using Layout = LayoutOf<R>;
  static constexpr bool kFreeBase = has_free_base<R>();
  static constexpr bool kNeedsGravity = (Terms::kNeedsGravity || ...);
  static constexpr int nq = R::nq, nv = R::nv, nx = nq + nv, ndx = 2 * nv, nu = R::nu, nz = ndx + nu;
  template <class S> using Model = ModelOf<R, S>;
  using LqModel = Model<Real>;
  using Lanes = Model<Pack>;
  static constexpr bool kPhases = false;  // all knots are of one kind
  template <class S> struct Knot : Terms::template Param<S>... {
    S dt;  // time step [s]; 0 at the terminal knot
  };

  static constexpr Real u_lo(int i) { return ControlBounds<R>::lo(i); }
  static constexpr Real u_hi(int i) { return ControlBounds<R>::hi(i); }

  // x_next = x (+) dx, dx padded
  template <class S> static void integrate(const S* x, const S* dx, S* x_next) {
    rbd_integrate<R>(x, dx + Layout::oq, x_next);
    for (int i = 0; i < nv; ++i) x_next[nq + i] = x[nq + i] + dx[Layout::ov + i];
  }

  // dx = x1 (-) x0, padded; the padding is set to zero
  template <class S> static void difference(const S* x0, const S* x1, S* dx) {
    for (int i = 0; i < Layout::nxp; ++i) dx[i] = 0.0;
    rbd_difference<R>(x0, x1, dx + Layout::oq);
    for (int i = 0; i < nv; ++i) dx[Layout::ov + i] = x1[nq + i] - x0[nq + i];
  }

  // Calls f(parameters, residual) for each constraint of a knot.
  template <class F> static void visit_constraints(Knot<Real>& knot, const Real* x, const Real* u, F f) {
    engram::visit_constraints<R, Knot<Real>, F, Terms...>(knot, x, u, f);
  }

  // Next state and cost of a knot.
  template <class S> static void calc(const Knot<S>& knot, const S* x, const S* u, S* x_next, S& cost) {
    RbdData<R, S> d;
    S a[nv];
    forward(x, u, d, a);
    S g[nv];
    if constexpr (kNeedsGravity) rbd_gravity<R>(d, g);
    cost = sum_of_costs(knot, {x, x + nq, u, d, g, nullptr});
    step(knot.dt, x, a, x_next);
  }

  // Cost of the terminal knot: kinematics only, no control.
  template <class S> static void calc_terminal(const Knot<S>& knot, const S* x, S& cost) {
    RbdData<R, S> d;
    S u[nu], g[nv];
    rbd_kinematics<R>(x, d);
    for (int i = 0; i < nu; ++i) u[i] = 0.0;
    if constexpr ((kNeedsMomentum<Terms> || ...)) {
      rbd_velocity<R>(x + nq, d);
      rbd_inertias<R>(d);
      rbd_composite_inertias<R>(d);
    }
    if constexpr (kNeedsGravity) {
      rbd_inertias<R>(d);
      rbd_gravity<R>(d, g);
    }
    cost = sum_of_costs(knot, {x, x + nq, u, d, g, nullptr});
  }

  // Next state, cost and linear-quadratic model of a knot.
  template <class S> static void linearize(const Knot<S>& knot, const S* x, const S* u, S* x_next, S& cost, Model<S>& M) {
    RbdData<R, S> d;
    S a[nv];
    Mat<S, nv, nv> da_dq, da_dv, Minv;
    forward(x, u, d, a);
    rbd_forward_derivatives<R>(d, a, da_dq, da_dv, Minv);
    for (int i = 0; i < nv; ++i) {
      for (int j = 0; j < Layout::nzp; ++j) M.D[i][j] = 0.0;
      for (int j = 0; j < nv; ++j) {
        M.D[i][Layout::oq + j] = knot.dt * da_dq(i, j);
        M.D[i][Layout::ov + j] = knot.dt * da_dv(i, j);
      }
      M.D[i][Layout::ov + i] += 1.0;
      for (int j = 0; j < nu; ++j) {
        if constexpr (Actuation<R>::kDrivesDofs) {
          M.D[i][Layout::ou + j] = knot.dt * Minv(i, Actuation<R>::dof(j));
        } else {
          for (int k = 0; k < nv; ++k)
            if (Actuation<R>::entry(k, j) != 0.0) M.D[i][Layout::ou + j] += knot.dt * Minv(i, k) * S(Actuation<R>::entry(k, j));
        }
      }
    }
    step(knot.dt, x, a, x_next);
    if constexpr (kFreeBase) {
      S w[6];
      for (int i = 0; i < 6; ++i) w[i] = knot.dt * x_next[nq + i];
      rbd_integrate_jacobians(w, M.E, M.G);
    }
    for (int i = 0; i < Layout::nzp; ++i) {
      M.Lz[i] = 0.0;
      for (int j = 0; j < Layout::nzp; ++j) M.Lzz[i][j] = 0.0;
    }
    S g[nv];
    Mat<S, nv, nv> dg_dq;
    if constexpr (kNeedsGravity) {
      rbd_gravity<R>(d, g);
      rbd_gravity_derivatives<R>(d, dg_dq);
    }
    const KnotView<R, S> view{x, x + nq, u, d, g, &dg_dq};
    cost = 0.0;
    ((cost += Terms::expand(static_cast<const typename Terms::template Param<S>&>(knot), view, M)), ...);
  }

 private:
  template <class S> static void forward(const S* x, const S* u, RbdData<R, S>& d, S* a) {
    S tau[nv];
    Actuation<R>::apply(u, tau);
    rbd_forward_dynamics<R>(x, x + nq, tau, d, a);
  }

  template <class S> static void step(S dt, const S* x, const S* a, S* x_next) {
    S dq[nv];
    for (int i = 0; i < nv; ++i) {
      x_next[nq + i] = x[nq + i] + dt * a[i];
      dq[i] = dt * x_next[nq + i];
    }
    rbd_integrate<R>(x, dq, x_next);
  }

  template <class S> static S sum_of_costs(const Knot<S>& knot, const KnotView<R, S>& view) {
    S cost = 0.0;
    ((cost += Terms::cost(static_cast<const typename Terms::template Param<S>&>(knot), view)), ...);
    return cost;
  }
};

}  // namespace engram
#endif  // CONTROLLER_OCP_OCP_H_
