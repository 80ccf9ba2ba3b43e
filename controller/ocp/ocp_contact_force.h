// Terms on the force of a contact, in the axes of the set (kContactAxes); cones open along z of these.
//
// A force term says which contact of the set it weighs (kContact), gives its cost, and adds gradient g (rows) and Gauss-Newton
// Hessian H (rows x rows) with respect to that force. The weight of an inactive contact must be 0 or its term vanish at force 0.
#ifndef CONTROLLER_OCP_OCP_CONTACT_FORCE_H_
#define CONTROLLER_OCP_OCP_CONTACT_FORCE_H_

#include "controller/ocp/ocp_activation.h"
#include "controller/rbd/rbd_contact.h"

namespace engram {

// 1/2 w max(0, a . l)^2 for each row a that visit(p, row) gives: the barrier of a polyhedral cone { l : a . l <= 0 }.
template <int rows, class Cone, class P, class S> inline S cone_cost(const P& p, S w, const S* l) {
  S c = 0.0;
  Cone::visit(p, [&](const S (&a)[rows]) {
    S e = 0.0;
    for (int i = 0; i < rows; ++i) e = madd(a[i], l[i], e);
    e = max(e, S(0.0));
    c = madd(e, e, c);
  });
  return S(0.5) * w * c;
}
template <int rows, class Cone, class P, class S> inline S cone_expand(const P& p, S w, const S* l, S* g, S (&H)[6][6]) {
  S c = 0.0;
  Cone::visit(p, [&](const S (&a)[rows]) {
    S e = 0.0;
    for (int i = 0; i < rows; ++i) e = madd(a[i], l[i], e);
    const S active = select(e >= S(0.0), w, S(0.0));
    e = max(e, S(0.0));
    c = madd(e, e, c);
    for (int i = 0; i < rows; ++i) {
      const S wa = active * a[i];
      g[i] = madd(wa, e, g[i]);
      for (int j = 0; j < rows; ++j) H[i][j] = madd(wa, a[j], H[i][j]);
    }
  });
  return S(0.5) * w * c;
}

// Friction pyramid of a point or a surface: |f_x|, |f_y| <= mu f_z, f_z >= 0.
template <int contact> struct FrictionConeTerm {
  static constexpr int kContact = contact, kFaces = 5;
  static constexpr bool kNeedsGravity = false;
  template <class S> struct Param {
    S friction_w;   // weight [1/N^2]
    S friction_mu;  // coefficient of friction
  };
  template <class S> static S cost(const Param<S>& p, const S* l) { return cone_cost<3, FrictionConeTerm>(p, p.friction_w, l); }
  template <class S> static S expand(const Param<S>& p, const S* l, S* g, S (&H)[6][6]) {
    return cone_expand<3, FrictionConeTerm>(p, p.friction_w, l, g, H);
  }
  template <class S, class F> static void visit(const Param<S>& p, F f) {
    for (int axis = 0; axis < 2; ++axis)
      for (Real sign : {1.0, -1.0}) {
        S a[3] = {0.0, 0.0, -p.friction_mu};
        a[axis] = sign;
        f(a);
      }
    const S normal[3] = {0.0, 0.0, -1.0};
    f(normal);
  }
};

// Wrench cone of a rectangular sole: friction pyramid, centre of pressure within the sole, bounds on the yaw torque.
// Source: Caron, Pham, Nakamura, Stability of Surface Contacts for Humanoid Robots (ICRA 2015), equations 15-24.
template <int contact> struct WrenchConeTerm {
  static constexpr int kContact = contact, kFaces = 17;
  static constexpr bool kNeedsGravity = false;
  template <class S> struct Param {
    S wrench_w;        // weight [1/N^2, 1/(N m)^2]
    S wrench_mu;       // coefficient of friction of the pyramid
    S wrench_half[2];  // half length (x) and half width (y) of the sole [m]
    S wrench_x[2];     // the sole's x axis in the world's (x, y): (cos, sin) of its yaw
  };
  template <class S> static S cost(const Param<S>& p, const S* l) { return cone_cost<6, WrenchConeTerm>(p, p.wrench_w, l); }
  template <class S> static S expand(const Param<S>& p, const S* l, S* g, S (&H)[6][6]) {
    return cone_expand<6, WrenchConeTerm>(p, p.wrench_w, l, g, H);
  }
  // Rows are written in the sole's axes and turned by its yaw.
  template <class S, class F> static void visit(const Param<S>& p, F f) {
    const S mu = p.wrench_mu, X = p.wrench_half[0], Y = p.wrench_half[1], c = p.wrench_x[0], s = p.wrench_x[1];
    const auto turned = [&](const S (&a)[6]) {
      const S row[6] = {c * a[0] - s * a[1], s * a[0] + c * a[1], a[2], c * a[3] - s * a[4], s * a[3] + c * a[4], a[5]};
      f(row);
    };
    for (int axis = 0; axis < 2; ++axis)
      for (Real sign : {1.0, -1.0}) {
        S a[6] = {0.0, 0.0, -mu, 0.0, 0.0, 0.0};
        a[axis] = sign;
        turned(a);
      }
    const S normal[6] = {0.0, 0.0, -1.0, 0.0, 0.0, 0.0};
    f(normal);
    for (int axis = 0; axis < 2; ++axis)
      for (Real sign : {1.0, -1.0}) {
        S a[6] = {0.0, 0.0, axis == 0 ? -Y : -X, 0.0, 0.0, 0.0};
        a[3 + axis] = sign;
        turned(a);
      }
    for (Real yaw : {-1.0, 1.0})
      for (Real sx : {1.0, -1.0})
        for (Real sy : {1.0, -1.0}) {
          const S a[6] = {sx * Y, sy * X, -mu * (X + Y), yaw * sx * mu, yaw * sy * mu, yaw};
          turned(a);
        }
  }
};

// Centre of pressure within a rectangular sole: |n_x| <= Y f_z, |n_y| <= X f_z.
template <int contact> struct CopTerm {
  static constexpr int kContact = contact, kFaces = 4;
  static constexpr bool kNeedsGravity = false;
  template <class S> struct Param {
    S cop_w;        // weight [1/(N m)^2]
    S cop_half[2];  // half length X and half width Y of the sole [m]
  };
  template <class S> static S cost(const Param<S>& p, const S* l) { return cone_cost<6, CopTerm>(p, p.cop_w, l); }
  template <class S> static S expand(const Param<S>& p, const S* l, S* g, S (&H)[6][6]) {
    return cone_expand<6, CopTerm>(p, p.cop_w, l, g, H);
  }
  template <class S, class F> static void visit(const Param<S>& p, F f) {
    for (int axis = 0; axis < 2; ++axis)
      for (Real sign : {1.0, -1.0}) {
        S a[6] = {0.0, 0.0, -p.cop_half[1 - axis], 0.0, 0.0, 0.0};
        a[3 + axis] = sign;
        f(a);
      }
  }
};

// The cone of one of the terms above as constraints a . l <= hi by multipliers (fddp_lagrangian.h), one a face, instead of a barrier.
// The weight of `cone` is not used. A knot whose contact is not active must have penalties of 0.
template <class Cone> struct ConeLimit {
  static constexpr int kContact = Cone::kContact, kFaces = Cone::kFaces;
  static constexpr bool kNeedsGravity = false;
  using A = Lagrangian<kFaces>;
  template <class S> struct Param : A::template Param<S> {
    typename Cone::template Param<S> cone;
  };
  template <class S> static void residual(const Param<S>& p, const S* l, S (&r)[kFaces]) {
    int face = 0;
    Cone::visit(p.cone, [&](const auto& a) {
      r[face] = 0.0;
      for (int i = 0; i < width(a); ++i) r[face] = madd(a[i], l[i], r[face]);
      ++face;
    });
  }
  template <class S> static S cost(const Param<S>& p, const S* l) {
    S r[kFaces], w[kFaces];
    residual(p, l, r);
    A::activate(p, r, w);
    return weighted_square(r, w);
  }
  template <class S> static S expand(const Param<S>& p, const S* l, S* g, S (&H)[6][6]) {
    S r[kFaces], w[kFaces];
    residual(p, l, r);
    A::activate(p, r, w);
    int face = 0;
    Cone::visit(p.cone, [&](const auto& a) {
      for (int i = 0; i < width(a); ++i) {
        const S wa = w[face] * a[i];
        g[i] = madd(wa, r[face], g[i]);
        for (int j = 0; j < width(a); ++j) H[i][j] = madd(wa, a[j], H[i][j]);
      }
      ++face;
    });
    return weighted_square(r, w);
  }

 private:
  template <class S, int n> static constexpr int width(const S (&)[n]) { return n; }
};

// 1/2 w |l - l*|^2 over the rows of the contact.
template <class C, int contact> struct ContactForceTerm {
  static constexpr int kContact = contact, rows = kContactTree<C>.rows[contact];
  static constexpr bool kNeedsGravity = false;
  template <class S> struct Param {
    S force_w;          // weight [1/N^2, 1/(N m)^2]
    S force_ref[rows];  // l* [N, N m]
  };
  template <class S> static S cost(const Param<S>& p, const S* l) {
    S c = 0.0;
    for (int i = 0; i < rows; ++i) c += (l[i] - p.force_ref[i]) * (l[i] - p.force_ref[i]);
    return S(0.5) * p.force_w * c;
  }
  template <class S> static S expand(const Param<S>& p, const S* l, S* g, S (&H)[6][6]) {
    for (int i = 0; i < rows; ++i) {
      g[i] += p.force_w * (l[i] - p.force_ref[i]);
      H[i][i] += p.force_w;
    }
    return cost(p, l);
  }
};

}  // namespace engram
#endif  // CONTROLLER_OCP_OCP_CONTACT_FORCE_H_
