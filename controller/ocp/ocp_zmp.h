// Term on the zero-moment point of all contacts: where on the ground plane z = h the forces' horizontal moment vanishes.
//
//   x = sum (p_x f_z - (p_z - h) f_x - n_y) / F    y = sum (p_y f_z - (p_z - h) f_y + n_x) / F    F = sum f_z
//
// over contacts at p with forces (f, n) in world axes. Source: Vukobratovic & Borovac, Zero-Moment Point (2004), equation 5.
#ifndef CONTROLLER_OCP_OCP_ZMP_H_
#define CONTROLLER_OCP_OCP_ZMP_H_

#include "controller/ocp/ocp_residual.h"
#include "controller/rbd/rbd_contact.h"

namespace engram {

// Activation of (x, y) - reference [m]. Nothing without a contact; below kLeastForce the force F is taken as this.
template <class C, template <int> class Activation = Weighted> struct ZmpTerm {
  static_assert(kContactAxes<C> == Axes::kLocalWorldAligned, "the zero-moment point is computed from forces in world axes");
  using R = typename C::Robot;
  using A = Activation<2>;
  static_assert(!kHasMultipliers<ZmpTerm>, "multipliers are for residuals of the state and cones");
  static constexpr bool kNeedsGravity = false, kOfContacts = true;
  static constexpr int kCoupledRows = 2, nf = kContactRows<C>;
  static constexpr Real kLeastForce = 1.0;  // N
  template <class S> struct Param : A::template Param<S> {
    S ref[2];  // m, world axes
    S height;  // h [m]
  };

  template <class S> static S cost(const Param<S>& p, unsigned active, const ContactData<C, S>& cd) {
    Point<S> at;
    S w[2];
    evaluate(p, active, cd, at, w);
    return weighted_square(at.e, w);
  }

  template <class S> static S expand_rows(const Param<S>& p, unsigned active, const ContactData<C, S>& cd, CoupledRow<R, nf, S>* row) {
    constexpr const ContactTree<C>& tree = kContactTree<C>;
    Point<S> at;
    S w[2];
    evaluate(p, active, cd, at, w);
    for (int i = 0; i < 2; ++i) {
      for (S& s : row[i].q) s = 0.0;
      for (S& s : row[i].v) s = 0.0;
      for (S& s : row[i].lambda) s = 0.0;
      row[i].e = at.e[i];
      row[i].w = w[i];
      for (int c = 0; c < C::n; ++c) {
        if (!contact_active(active, c)) continue;
        const S* const f = cd.lambda + tree.first[c];
        S* const l = row[i].lambda + tree.first[c];
        const S lift = cd.p_WF[c][2] - p.height, inverse = S(1.0) / at.F;
        l[2] = (cd.p_WF[c][i] - at.z[i] * at.light) * inverse;
        l[i] = -lift * inverse;
        if (C::kind[c] == ContactKind::kSurface) l[4 - i] = i == 0 ? -inverse : inverse;
        for (int a = 0; a < tree.path_n[c]; ++a) {
          const Vec3<S>& dp = cd.J[c][a].lin;
          row[i].q[tree.path[c][a]] += (dp[i] * f[2] - dp[2] * f[i]) * inverse;
        }
      }
    }
    return weighted_square(at.e, w);
  }

 private:
  template <class S> struct Point {
    S z[2], e[2], F, light;  // (x, y); after activation; force; 0 where F is the least one, else 1
  };
  template <class S> static void evaluate(const Param<S>& p, unsigned active, const ContactData<C, S>& cd, Point<S>& at, S (&w)[2]) {
    constexpr const ContactTree<C>& tree = kContactTree<C>;
    S F = 0.0;
    at.z[0] = at.z[1] = 0.0;
    for (int c = 0; c < C::n; ++c) {
      if (!contact_active(active, c)) continue;
      const S* const f = cd.lambda + tree.first[c];
      F += f[2];
      for (int i = 0; i < 2; ++i) at.z[i] += cd.p_WF[c][i] * f[2] - (cd.p_WF[c][2] - p.height) * f[i];
      if (C::kind[c] == ContactKind::kPoint) continue;
      at.z[0] -= f[4];
      at.z[1] += f[3];
    }
    at.light = select(F > S(kLeastForce), S(1.0), S(0.0));
    at.F = max(F, S(kLeastForce));
    for (int i = 0; i < 2; ++i) {
      at.z[i] /= at.F;
      at.e[i] = at.z[i] - p.ref[i];
    }
    A::activate(p, at.e, w);
    if (active == 0)
      for (S& s : w) s = 0.0;
  }
};

}  // namespace engram
#endif  // CONTROLLER_OCP_OCP_ZMP_H_
