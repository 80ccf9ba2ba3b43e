// Forward kinematics, and the data the rigid-body algorithms share.
#ifndef CONTROLLER_RBD_RBD_KINEMATICS_H_
#define CONTROLLER_RBD_RBD_KINEMATICS_H_

#include "controller/rbd/rbd_spatial.h"
#include "controller/rbd/rbd_tree.h"

namespace engram {

// Work space of one robot R over S. Spatial quantities are at the world origin in world axes.
template <class R, class S> struct RbdData {
  // written by rbd_kinematics
  Mat3<S> R_WJ[R::nj];  // joint axes in world
  Vec3<S> p_WJ[R::nj];  // joint origin [m]
  Motion<S> J[R::nv];   // column k: velocity of the subtree of dof k per unit of v[k]

  // written by rbd_velocity
  Motion<S> V[R::nj];  // body velocity

  // written by rbd_inertias
  Inertia<S> Y[R::nj];  // body inertia
  // written by rbd_crba
  Inertia<S> Yc[R::nj];  // inertia of the subtree

  // written by rbd_rnea and rbd_forward_dynamics
  Motion<S> A[R::nj];  // body acceleration minus gravity
  Force<S> f[R::nj];   // force that moves the body alone: Y A + V x* Y V

  // written by rbd_forward_dynamics: M = L' D L, L unit lower triangular (its diagonal holds D)
  BranchMatrix<R, S> L;
  S D_inv[R::nv];
};

// Rotation matrix of a unit quaternion (x y z w).
template <class S> ENGRAM_INLINE Mat3<S> rotation_of(const S* quat) {
  const S x = quat[0], y = quat[1], z = quat[2], w = quat[3];
  const S x2 = x + x, y2 = y + y, z2 = z + z;
  return {{nmadd(y, y2, nmadd(z, z2, S(1.0))), madd(x, y2, w * z2), msub(x, z2, w * y2)},
          {msub(x, y2, w * z2), nmadd(x, x2, nmadd(z, z2, S(1.0))), madd(y, z2, w * x2)},
          {madd(x, z2, w * y2), msub(y, z2, w * x2), nmadd(x, x2, nmadd(y, y2, S(1.0)))}};
}

// Sine and cosine of the angle of a joint.
template <class R, class S> struct JointAngles {
  const S* q;

  ENGRAM_INLINE explicit JointAngles(const S* q) : q(q) {}
  ENGRAM_INLINE void at(int i, S& s, S& c) const { sincos(q[R::iq[i]], s, c); }
};

// Of one state: all joints beforehand, as many side by side as a Pack holds.
template <class R> struct JointAngles<R, Real> {
  Real sine[R::nj + kLanes], cosine[R::nj + kLanes];

  ENGRAM_INLINE explicit JointAngles(const Real* q) {
    for (int i = 0; i < R::nj; i += kLanes) {
      Pack angle(0.0), s, c;
      for (int l = 0; l < kLanes && i + l < R::nj; ++l)
        if (R::kind[i + l] == kRevolute) angle.set(l, q[R::iq[i + l]]);
      sincos(angle, s, c);
      store_pack(s, sine + i);
      store_pack(c, cosine + i);
    }
  }
  ENGRAM_INLINE void at(int i, Real& s, Real& c) const {
    s = sine[i];
    c = cosine[i];
  }
};

// q (nq) -> d.R_WJ, d.p_WJ, d.J
template <class R, class S> inline void rbd_kinematics(const S* q, RbdData<R, S>& d) {
  const JointAngles<R, S> angles(q);
  for (int i = 0; i < R::nj; ++i) {
    // joint frame at q_i = 0
    Mat3<S> R_WJ = constant33<S>(R::R_PJ[i]);
    Vec3<S> p_WJ = constant3<S>(R::p_PJ[i]);
    if (const int p = R::parent[i]; p >= 0) {
      p_WJ = mul_add(d.R_WJ[p], p_WJ, d.p_WJ[p]);
      R_WJ = matmul(d.R_WJ[p], R_WJ);
    }
    const S* qi = q + R::iq[i];
    Motion<S>* J = d.J + R::iv[i];
    if (has_free_base<R>() && i == 0) {
      p_WJ = mul_add(R_WJ, Vec3<S>(qi[0], qi[1], qi[2]), p_WJ);
      R_WJ = matmul(R_WJ, rotation_of(qi + 3));
      for (int k = 0; k < 3; ++k) {
        const Vec3<S> e = R_WJ.column(k);
        J[k] = {e, Vec3<S>::Zero()};
        J[3 + k] = {cross(p_WJ, e), e};
      }
    } else if (R::kind[i] == kRevolute) {
      S s, c;
      angles.at(i, s, c);
      const Vec3<S> x = R_WJ.column(0), y = R_WJ.column(1), z = R_WJ.column(2);
      R_WJ = {madd(x, c, y * s), madd(y, c, x * -s), z};
      J[0] = {cross(p_WJ, z), z};
    } else {
      const Vec3<S> z = R_WJ.column(2);
      p_WJ = madd(z, qi[0], p_WJ);
      J[0] = {z, Vec3<S>::Zero()};
    }
    d.R_WJ[i] = R_WJ;
    d.p_WJ[i] = p_WJ;
  }
}

// m + sum_k J_k x_k over the dofs of joint i
template <class R, class S> ENGRAM_INLINE Motion<S> rbd_add_joint_motion(const RbdData<R, S>& d, int i, const S* x, Motion<S> m) {
  for (int k = R::iv[i]; k <= kTree<R>.last[i]; ++k) m = madd(d.J[k], x[k], m);
  return m;
}

// v (nv) -> d.V:  V_i = V_parent + J_i v_i. After rbd_kinematics.
template <class R, class S> inline void rbd_velocity(const S* v, RbdData<R, S>& d) {
  for (int i = 0; i < R::nj; ++i) {
    const int p = R::parent[i];
    d.V[i] = rbd_add_joint_motion(d, i, v, p < 0 ? Motion<S>::zero() : d.V[p]);
  }
}

// Y (nj): inertia of every body. After rbd_kinematics.
template <class R, class S> inline void rbd_body_inertias(const RbdData<R, S>& d, Inertia<S>* Y) {
  for (int i = 0; i < R::nj; ++i) {
    S Ic[6];
    for (int e = 0; e < 6; ++e) Ic[e] = S(R::inertia[i][e]);
    Y[i] = inertia_in_world(d.R_WJ[i], d.p_WJ[i], S(R::mass[i]), constant3<S>(R::com[i]), Ic);
  }
}

// Mass, centre of mass and inertia of the bodies, entry by entry; zero beyond the last.
template <class R> struct BodyConstants {
  Real entry[10][R::nj + kLanes] = {};

  constexpr BodyConstants() {
    for (int i = 0; i < R::nj; ++i) {
      entry[0][i] = R::mass[i];
      for (int e = 0; e < 3; ++e) entry[1 + e][i] = R::com[i][e];
      for (int e = 0; e < 6; ++e) entry[4 + e][i] = R::inertia[i][e];
    }
  }
};
template <class R> inline constexpr BodyConstants<R> kBodyConstants{};

// Of one state: as many bodies side by side as a Pack holds.
template <class R> inline void rbd_body_inertias(const RbdData<R, Real>& d, Inertia<Real>* Y) {
  for (int i = 0; i < R::nj; i += kLanes) {
    const int n = R::nj - i < kLanes ? R::nj - i : kLanes;
    const auto constant = [&](int e) { return load_pack(kBodyConstants<R>.entry[e] + i); };
    const auto gather = [&](auto entry) ENGRAM_INLINE_LAMBDA {
      Pack x;
      for (int l = 0; l < kLanes; ++l) x.set(l, entry(l < n ? i + l : i));
      return x;
    };
    Mat3<Pack> R_WJ;
    Vec3<Pack> p_WJ;
    for (int r = 0; r < 3; ++r) {
      p_WJ[r] = gather([&](int b) { return d.p_WJ[b][r]; });
      for (int c = 0; c < 3; ++c) R_WJ(r, c) = gather([&](int b) { return d.R_WJ[b](r, c); });
    }
    const Pack Ic[6] = {constant(4), constant(5), constant(6), constant(7), constant(8), constant(9)};
    const Inertia<Pack> side_by_side =
        inertia_in_world(R_WJ, p_WJ, constant(0), Vec3<Pack>(constant(1), constant(2), constant(3)), Ic);
    for (int l = 0; l < n; ++l) {
      Inertia<Real>& y = Y[i + l];
      y.mass = R::mass[i + l];
      for (int r = 0; r < 3; ++r) y.moment[r] = side_by_side.moment[r][l];
      for (int e = 0; e < 6; ++e) y.I[e] = side_by_side.I[e][l];
    }
  }
}

// d.Y: inertia of every body. After rbd_kinematics.
template <class R, class S> inline void rbd_inertias(RbdData<R, S>& d) { rbd_body_inertias(d, d.Y); }

// Acceleration of the world that stands in for gravity.
template <class R, class S> ENGRAM_INLINE Motion<S> rbd_gravity_acceleration() {
  return {-constant3<S>(R::gravity), Vec3<S>::Zero()};
}

}  // namespace engram
#endif  // CONTROLLER_RBD_RBD_KINEMATICS_H_
