// A knot of the optimal control problem with contacts: the robot of a contact set C, and a sum of cost terms.
//
//   in time:      a = contact dynamics (q, v, u),  v' = v + dt a,  q' = q (+) dt v'
//   an impact:    v' = v + jump,  q' = q           no control, no time; its phase has the bit kImpact
//
// The phase of a knot (a mask of active contacts, plus kImpact) is part of the horizon: changing it changes no size. Terms are those
// of ocp.h, force terms (ocp_contact_force.h), which see the force of one contact (the impulse at an impact), and terms of all contacts
// (ocp_zmp.h). Terms that couple more than q with q, or forces of several contacts, leave rows (CoupledRow) instead of a Hessian.
#ifndef CONTROLLER_OCP_OCP_CONTACT_H_
#define CONTROLLER_OCP_OCP_CONTACT_H_

#include "controller/ocp/ocp_contact_force.h"
#include "controller/ocp/ocp_contact_model.h"
#include "controller/rbd/rbd_com.h"
#include "controller/rbd/rbd_impulse.h"

#include <type_traits>

namespace engram {

inline constexpr unsigned kImpact = kImpactPhase;

template <class Term, class = void> inline constexpr bool kIsTermOfContacts = false;
template <class Term> inline constexpr bool kIsTermOfContacts<Term, std::void_t<decltype(Term::kOfContacts)>> = true;

// References of the contacts, if the set asks for them by kp > 0.
template <class C, class S, bool = (C::kp > 0.0)> struct ContactParam {
  const ContactReference<C, S>* reference() const { return nullptr; }
};
template <class C, class S> struct ContactParam<C, S, true> {
  ContactReference<C, S> contact_ref;
  const ContactReference<C, S>* reference() const { return &contact_ref; }
};

template <class C, class... Terms> struct ContactOcp {
  using R = typename C::Robot;
  using Contacts = C;
  using Layout = LayoutOf<R>;
  static constexpr int nt = (kCoupledRows<Terms> + ... + 0);  // rows of coupled residuals
  using LqModel = ContactKnotModel<C, nt>;
  template <class S> using LanesOf = ContactLanes<C, nt, S>;
  using Lanes = LanesOf<Pack>;
  static constexpr bool kPhases = true, kFreeBase = has_free_base<R>();
  static constexpr int nq = R::nq, nv = R::nv, nx = nq + nv, ndx = 2 * nv, nu = R::nu, nz = ndx + nu, nf = kContactRows<C>;
  static_assert(!(Terms::kNeedsGravity || ...), "gravity torque is not what holds a robot on its feet");
  template <class S> struct Knot : Terms::template Param<S>..., ContactParam<C, S> {
    S dt;  // time step [s]; 0 at an impact and at the terminal knot
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

  // Calls f(parameters, residual) for each constraint of a knot: of its state, then of the forces of its contacts.
  template <class F> static void visit_constraints(unsigned phase, Knot<Real>& knot, const Real* x, const Real* u, F f) {
    engram::visit_constraints<R, Knot<Real>, F, Terms...>(knot, x, u, f);
    if constexpr (((kHasMultipliers<Terms> && kIsForceTerm<Terms>) || ...)) {
      if (phase == kTerminalPhase) return;
      const unsigned active = phase & ~kImpact;
      RbdData<R, Real> d;
      ContactData<C, Real> cd;
      Real a[nv], lambda[nf];
      dynamics(phase, knot, x, u, d, cd, a);
      rbd_contact_forces_seen(active, cd, lambda);
      const auto visit = [&](auto* term) {
        using Term = std::remove_pointer_t<decltype(term)>;
        if constexpr (kHasMultipliers<Term> && kIsForceTerm<Term>) {
          Real r[Term::kFaces];
          Term::residual(param_of<Term>(knot), lambda + kContactTree<C>.first[Term::kContact], r);
          if (contact_active(active, Term::kContact)) f(param_of<Term>(knot), r);
        }
      };
      (visit(static_cast<Terms*>(nullptr)), ...);
    }
  }

  // Next state and cost of a knot.
  template <class S> static void calc(unsigned phase, const Knot<S>& knot, const S* x, const S* u, S* x_next, S& cost) {
    RbdData<R, S> d;
    ContactData<C, S> cd;
    S a[nv];
    dynamics(phase, knot, x, u, d, cd, a);
    cost = sum_of_costs(knot, {x, x + nq, u, d, nullptr, nullptr}, phase & ~kImpact, cd);
    step(phase, knot.dt, x, a, x_next);
  }

  // Cost of the terminal knot: kinematics only, no control, no forces.
  template <class S> static void calc_terminal(const Knot<S>& knot, const S* x, S& cost) {
    RbdData<R, S> d;
    ContactData<C, S> cd;
    S u[nu];
    terminal_kinematics(x, d, cd);
    for (S& s : u) s = 0.0;
    cost = sum_of_costs(knot, {x, x + nq, u, d, nullptr, nullptr}, 0, cd);
  }

  // Next state, cost and the lanes' share of the linear-quadratic model of knots of one phase.
  template <class S>
  static void linearize(unsigned phase, const Knot<S>& knot, const S* x, const S* u, S* x_next, S& cost, LanesOf<S>& w) {
    clear_costs(w);
    if (phase == kTerminalPhase) return linearize_terminal(knot, x, u, x_next, cost, w);
    const unsigned active = phase & ~kImpact;
    S a[nv];
    dynamics(phase, knot, x, u, w.d, w.cd, a);
    step(phase, knot.dt, x, a, x_next);
    const KnotView<R, S> view{x, x + nq, u, w.d, nullptr, nullptr};
    cost = expand_terms(knot, view, active, w);
    if (phase & kImpact) {
      rbd_impulse_derivatives(x, x + nq, a, active, w.d, w.cd, w.x);
    } else {
      rbd_contact_accelerate(a, active, w.cd, w.d);
      rbd_rnea_derivatives(w.d, w.x.Xq, w.x.Xv);
      rbd_solve_upper_related(w.d, w.x.Xq);
      rbd_solve_upper_related(w.d, w.x.Xv);
      control_columns(w);
      int u_dof[nu];
      for (int i = 0; i < nu; ++i) u_dof[i] = Actuation<R>::dof(i);
      rbd_contact_right_sides(active, w.cd, u_dof, w.x,
                              [&](int c, auto& dTq, auto& dTv) { rbd_contact_constraint_derivatives(w.d, w.cd, c, dTq, dTv); });
    }
    if constexpr (kFreeBase) {
      S dq[6];
      for (int i = 0; i < 6; ++i) dq[i] = knot.dt * x_next[nq + i];
      rbd_integrate_jacobians(dq, w.cost.E, w.cost.G);
    }
  }

  // The model of the knot in one lane.
  static void finish(unsigned phase, Real dt, const Lanes& w, int lane, LqModel& m) {
    if (phase == kTerminalPhase) return contact_finish_costs(w, lane, 0, m);
    const unsigned active = phase & ~kImpact;
    contact_finish_dynamics(w, lane, active, phase & kImpact ? 1.0 : dt, m);
    contact_finish_costs(w, lane, active, m);
    if (phase & kImpact)  // no control acts, and nothing depends on it: any positive weight keeps Quu regular
      for (int i = 0; i < nu; ++i) m.h[Layout::ou + i] = 1.0;
  }

 private:
  template <class S>
  static void linearize_terminal(const Knot<S>& knot, const S* x, const S* u, S* x_next, S& cost, LanesOf<S>& w) {
    terminal_kinematics(x, w.d, w.cd);
    cost = expand_terms(knot, {x, x + nq, u, w.d, nullptr, nullptr}, 0, w);
    for (int i = 0; i < nx; ++i) x_next[i] = x[i];
  }

  // What the terms see at the terminal knot: kinematics, no forces.
  template <class S> static void terminal_kinematics(const S* x, RbdData<R, S>& d, ContactData<C, S>& cd) {
    rbd_kinematics(x, d);
    rbd_velocity(x + nq, d);
    if constexpr ((kNeedsMomentum<Terms> || ...)) {
      rbd_inertias(d);
      rbd_composite_inertias(d);
    } else {
      rbd_subtree_moments(d);
    }
    for (S& l : cd.lambda) l = 0.0;
  }

  // Accelerations a (nv), or the jump of the velocity at an impact; contact forces or impulses in cd.lambda.
  template <class S>
  static void dynamics(unsigned phase, const Knot<S>& knot, const S* x, const S* u, RbdData<R, S>& d, ContactData<C, S>& cd, S (&a)[nv]) {
    if (phase & kImpact) {
      rbd_impulse(x, x + nq, phase & ~kImpact, d, cd, a);
    } else {
      S tau[nv];
      Actuation<R>::apply(u, tau);
      rbd_contact_dynamics(x, x + nq, tau, knot.reference(), phase, d, cd, a);
    }
  }

  template <class S> static void step(unsigned phase, S dt, const S* x, const S* a, S* x_next) {
    S dq[nv];
    const S h = phase & kImpact ? S(1.0) : dt;
    for (int i = 0; i < nv; ++i) {
      x_next[nq + i] = madd(h, a[i], x[nq + i]);
      dq[i] = dt * x_next[nq + i];
    }
    rbd_integrate<R>(x, dq, x_next);
  }

  template <class S> static S sum_of_costs(const Knot<S>& knot, const KnotView<R, S>& view, unsigned active, const ContactData<C, S>& cd) {
    S lambda[nf], cost = 0.0;
    rbd_contact_forces_seen(active, cd, lambda);
    ((cost += cost_of<Terms>(knot, view, active, cd, lambda)), ...);
    return cost;
  }
  template <class Term, class S>
  static S cost_of(const Knot<S>& knot, const KnotView<R, S>& view, unsigned active, const ContactData<C, S>& cd, const S* lambda) {
    const typename Term::template Param<S>& p = knot;
    if constexpr (kIsForceTerm<Term>) return Term::cost(p, lambda + kContactTree<C>.first[Term::kContact]);
    else if constexpr (kIsTermOfContacts<Term>) return Term::cost(p, active, cd);
    else return Term::cost(p, view);
  }

  // Adds the terms' models to w; returns their costs.
  template <class S> static S expand_terms(const Knot<S>& knot, const KnotView<R, S>& view, unsigned active, LanesOf<S>& w) {
    S lambda[nf], cost = 0.0;
    rbd_contact_forces_seen(active, w.cd, lambda);
    ((cost += expand<Terms>(knot, view, active, lambda, w)), ...);
    return cost;
  }
  template <class Term, class S>
  static S expand(const Knot<S>& knot, const KnotView<R, S>& view, unsigned active, const S* lambda, LanesOf<S>& w) {
    const typename Term::template Param<S>& p = knot;
    if constexpr (kIsForceTerm<Term>) {
      constexpr int first = kContactTree<C>.first[Term::kContact];
      return Term::expand(p, lambda + first, w.g + first, w.H[Term::kContact]);
    } else if constexpr (kIsTermOfContacts<Term>) {
      return Term::expand_rows(p, active, w.cd, w.row + first_row<Term>());
    } else if constexpr (kCoupledRows<Term> > 0) {
      return Term::template expand_rows<nf>(p, view, w.row + first_row<Term>());
    } else {
      return Term::expand(p, view, w.cost);
    }
  }
  // Where the rows of a term begin.
  template <class Term> static constexpr int first_row() {
    int row = 0;
    bool found = false;
    ((found = found || std::is_same_v<Term, Terms>, row += found ? 0 : kCoupledRows<Terms>), ...);
    return row;
  }

  // Zero where terms add: gradient, lower block qq and diagonal.
  template <class S> static void clear_costs(LanesOf<S>& w) {
    for (int i = 0; i < Layout::nzp; ++i) w.cost.Lz[i] = w.cost.Lzz[i][i] = 0.0;
    for (int i = 0; i < nv; ++i)
      for (int j = 0; j < i; ++j) w.cost.Lzz[i][j] = 0.0;
    for (S& g : w.g) g = 0.0;
    for (auto& H : w.H)
      for (auto& row : H)
        for (S& h : row) h = 0.0;
  }

  // Xu = L^-T d(M a + b - J' lambda - B u)/du = -L^-T B
  template <class S> static void control_columns(LanesOf<S>& w) {
    for (int i = 0; i < nu; ++i) {
      const int dof = Actuation<R>::dof(i);
      for (int k = 0; k < nv; ++k) w.x.Xu[k][i] = S(-Actuation<R>::entry(k, i));
      for (int k = dof < 0 ? nv - 1 : dof; k >= 0; k = dof < 0 ? k - 1 : kTree<R>.parent[k])
        for (int j = kTree<R>.parent[k]; j >= 0; j = kTree<R>.parent[j]) w.x.Xu[j][i] = nmadd(w.d.L(k, j), w.x.Xu[k][i], w.x.Xu[j][i]);
    }
  }
};

}  // namespace engram
#endif  // CONTROLLER_OCP_OCP_CONTACT_H_
