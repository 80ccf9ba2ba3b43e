// A cost term made of a residual and an activation (ocp_activation.h).
//
// A residual F of m rows is a struct with
//   using Robot;  static constexpr int rows = m;  static constexpr bool kOfVelocity;     does it depend on v?
//   static constexpr DofPath<Robot> path;                                                the dofs it depends on
//   template <class S> struct Reference;                                                 scalars only
//   template <class S> static void value(const Reference<S>&, const KnotView<Robot, S>&, S (&r)[rows]);
//   template <class S> static void jacobian(const Reference<S>&, const KnotView<Robot, S>&, S (&J)[rows][2 * nv]);
// The columns of J are those of path in q and then, if it depends on velocity, those of path in v.
//
// Several terms of one knot have parameters of the same names: reach them by param_of<Term>(knot).
#ifndef CONTROLLER_OCP_OCP_RESIDUAL_H_
#define CONTROLLER_OCP_OCP_RESIDUAL_H_

#include "controller/ocp/ocp_activation.h"
#include "controller/ocp/ocp_view.h"
#include "controller/rbd/rbd_crba.h"

#include <type_traits>

namespace engram {

template <class Term, class Knot> auto& param_of(Knot& knot) {
  return static_cast<typename Term::template Param<std::decay_t<decltype(knot.dt)>>&>(knot);
}

// True if a term looks at velocities and inertias; how many of its rows couple coordinates beyond q with q.
template <class Term, class = void> inline constexpr bool kNeedsMomentum = false;
template <class Term> inline constexpr bool kNeedsMomentum<Term, std::void_t<decltype(Term::kNeedsMomentum)>> = Term::kNeedsMomentum;
template <class Term, class = void> inline constexpr int kCoupledRows = 0;
template <class Term> inline constexpr int kCoupledRows<Term, std::void_t<decltype(Term::kCoupledRows)>> = Term::kCoupledRows;

// Rows of residuals that couple coordinates of a knot: what a problem with contacts (ocp_contact_model.h) keeps of them.
template <class R, int nf, class S> struct CoupledRow {
  S q[R::nv], v[R::nv];  // d e / d q, d e / d v
  S lambda[nf];          // d e / d lambda
  S e, w;                // residual after activation, weight
};

template <class F, template <int> class Activation = Weighted> struct ResidualTerm {
  using R = typename F::Robot;
  using A = Activation<F::rows>;
  static constexpr int rows = F::rows, n = F::path.n, columns = F::kOfVelocity ? 2 * n : n;
  static constexpr bool kNeedsGravity = false, kNeedsMomentum = F::kOfVelocity;
  static constexpr int kCoupledRows = F::kOfVelocity ? rows : 0;  // couples q and v
  template <class S> struct Param : A::template Param<S> {
    typename F::template Reference<S> ref;
  };

  template <class S> static void residual(const Param<S>& p, const KnotView<R, S>& k, S (&r)[rows]) { F::value(p.ref, k, r); }

  template <class S> static S cost(const Param<S>& p, const KnotView<R, S>& k) {
    S r[rows], w[rows];
    F::value(p.ref, k, r);
    A::activate(p, r, w);
    return weighted_square(r, w);
  }

  template <class S> static S expand(const Param<S>& p, const KnotView<R, S>& k, ModelOf<R, S>& M) {
    S r[rows], w[rows], J[rows][2 * R::nv];
    F::value(p.ref, k, r);
    F::jacobian(p.ref, k, J);
    A::activate(p, r, w);
    int z[2 * R::nv];
    for (int a = 0; a < columns; ++a) z[a] = a < n ? F::path.dof[a] : LayoutOf<R>::ov + F::path.dof[a - n];
    add_gauss_newton(J, z, columns, r, w, M);
    return weighted_square(r, w);
  }

  // The same as rows.
  template <int nf, class S> static S expand_rows(const Param<S>& p, const KnotView<R, S>& k, CoupledRow<R, nf, S>* row) {
    S r[rows], w[rows], J[rows][2 * R::nv];
    F::value(p.ref, k, r);
    F::jacobian(p.ref, k, J);
    A::activate(p, r, w);
    for (int i = 0; i < rows; ++i) {
      for (int a = 0; a < R::nv; ++a) row[i].q[a] = row[i].v[a] = 0.0;
      for (int a = 0; a < nf; ++a) row[i].lambda[a] = 0.0;
      for (int a = 0; a < n; ++a) {
        row[i].q[F::path.dof[a]] = J[i][a];
        if constexpr (F::kOfVelocity) row[i].v[F::path.dof[a]] = J[i][n + a];
      }
      row[i].e = r[i];
      row[i].w = w[i];
    }
    return weighted_square(r, w);
  }
};

// True if a term holds a constraint by multipliers.
template <class Term, class = void> inline constexpr bool kHasMultipliers = false;
template <class Term> inline constexpr bool kHasMultipliers<Term, std::void_t<decltype(Term::A::kHasMultipliers)>> = true;

// True if a term is of the force of one contact (ocp_contact_force.h).
template <class Term, class = void> inline constexpr bool kIsForceTerm = false;
template <class Term> inline constexpr bool kIsForceTerm<Term, std::void_t<decltype(Term::kContact)>> = true;

// Calls f(parameters, residual) for each of the terms that holds a constraint of the state, at a state.
template <class R, class Knot, class F, class... Terms> void visit_constraints(Knot& knot, const Real* x, const Real* u, F f) {
  if constexpr (((kHasMultipliers<Terms> && !kIsForceTerm<Terms>) || ...)) {
    RbdData<R, Real> d;
    rbd_kinematics(x, d);
    rbd_velocity(x + R::nq, d);
    rbd_inertias(d);
    rbd_composite_inertias(d);
    const KnotView<R, Real> view{x, x + R::nq, u, d, nullptr, nullptr};
    const auto visit = [&](auto* term) {
      using Term = std::remove_pointer_t<decltype(term)>;
      if constexpr (kHasMultipliers<Term> && !kIsForceTerm<Term>) {
        Real r[Term::rows];
        Term::residual(param_of<Term>(knot), view, r);
        f(param_of<Term>(knot), r);
      }
    };
    (visit(static_cast<Terms*>(nullptr)), ...);
  }
}

}  // namespace engram
#endif  // CONTROLLER_OCP_OCP_RESIDUAL_H_
