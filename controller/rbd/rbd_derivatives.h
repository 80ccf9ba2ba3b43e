// Analytic derivatives of inverse and forward dynamics.
// Source: Carpentier & Mansard, Analytical Derivatives of Rigid Body Dynamics Algorithms (RSS 2018), in world coordinates.
// The derivative with respect to q is taken along the tangent of rbd_manifold.h (free base: body twist).
//
// With V_p, A_p velocity and (gravity-free) acceleration of the parent body, V_i of the body itself, column k changes
//   a velocity down the tree by        dVdq_k = V_p x J_k,                        dVdv_k = J_k,
//   an acceleration down the tree by   dAdq_k = A_p x J_k + V_p x (V_p x J_k),    dAdv_k = (V_p + V_i) x J_k,
// up to terms that move with the receiving body and cancel. A force down the tree then changes by
//   dF = Y dA + C dV,   C x = V x* Y x - Y (V x x) + x x* Y V.
// For a particle of mass m at r with velocity u, C x = 2 m (w_x x u) acting at r: C sees the angular part of x only.
// Summed over a body: force w_x x 2p with p the linear momentum, moment (2 tr(N) 1 - 2 N) w_x with N = sum m u r'.
#ifndef CONTROLLER_RBD_RBD_DERIVATIVES_H_
#define CONTROLLER_RBD_RBD_DERIVATIVES_H_

#include "controller/rbd/rbd_forward.h"

namespace engram {

// C above: C x = (w x p2, D w).
template <class S> struct Coriolis {
  Vec3<S> p2;
  Mat3<S> D;

  ENGRAM_INLINE Coriolis& operator+=(const Coriolis& b) {
    p2 += b.p2;
    D += b.D;
    return *this;
  }
  ENGRAM_INLINE Force<S> times_add(const Vec3<S>& w, const Force<S>& f) const {
    return {cross_add(w, p2, f.lin), mul_add(D, w, f.ang)};
  }
  // g with J . C x = g . w_x
  ENGRAM_INLINE Vec3<S> transposed_times(const Motion<S>& J) const { return cross_add(p2, J.lin, mul_transposed(D, J.ang)); }
};

// N = sum m (u + w x r) r' = u mc' + [w]x E,  E = sum m r r' = tr(I)/2 1 - I  (tr([w]x E) = 0)
template <class S> ENGRAM_INLINE Coriolis<S> coriolis_of(const Inertia<S>& Y, const Motion<S>& V) {
  Coriolis<S> C;
  const S half_trace = 0.5 * (Y.I[0] + Y.I[3] + Y.I[5]);
  const Vec3<S> w2 = V.ang * S(2.0), u2 = V.lin * S(2.0);
  C.p2 = cross_add<S>(w2, Y.moment, u2 * Y.mass);
  const S trace = dot(u2, Y.moment);
  const auto minus_column = [&](const Vec3<S>& e, S moment) ENGRAM_INLINE_LAMBDA { return -cross_add(w2, e, u2 * moment); };
  C.D = {minus_column({half_trace - Y.I[0], -Y.I[1], -Y.I[2]}, Y.moment[0]) + Vec3<S>(trace, S(0.0), S(0.0)),
         minus_column({-Y.I[1], half_trace - Y.I[3], -Y.I[4]}, Y.moment[1]) + Vec3<S>(S(0.0), trace, S(0.0)),
         minus_column({-Y.I[2], -Y.I[4], half_trace - Y.I[5]}, Y.moment[2]) + Vec3<S>(S(0.0), S(0.0), trace)};
  return C;
}

// What column k and body i contribute.
template <class R, class S> struct BranchDerivatives {
  Motion<S> dAdq[R::nv], dAdv[R::nv];
  Vec3<S> dVdq[R::nv];   // angular part: all that C sees
  Force<S> f[R::nj];     // of the body, then of the subtree
  Coriolis<S> C[R::nj];  // likewise

  ENGRAM_INLINE explicit BranchDerivatives(const RbdData<R, S>& d) {
    for (int i = 0; i < R::nj; ++i) {
      const int p = R::parent[i];
      f[i] = d.f[i];
      C[i] = coriolis_of(d.Y[i], d.V[i]);
      for (int k = R::iv[i]; k <= kTree<R>.last[i]; ++k) {
        if (p < 0) {
          dVdq[k].setZero();
          dAdq[k] = cross(rbd_gravity_acceleration<R, S>(), d.J[k]);
          dAdv[k] = cross(d.V[i], d.J[k]);
        } else {
          const Motion<S> dV = cross(d.V[p], d.J[k]);
          dVdq[k] = dV.ang;
          dAdq[k] = cross_add(d.A[p], d.J[k], cross(d.V[p], dV));
          dAdv[k] = dV * S(2.0);  // V_i x J = V_p x J: J is a single column
        }
      }
    }
    for (int i = R::nj - 1; i >= 0; --i) {
      if (const int p = R::parent[i]; p >= 0) {
        f[p] += f[i];
        C[p] += C[i];
      }
    }
  }
};

// What row and column k of the derivatives are made of, a dof j towards the root at a time:
//   column k, row j:  J_j . dF_k;   row k, column j:  J_k . (Yc dA_j + C dV_j) = (Yc J_k) . dA_j + g . w(dV_j)
template <class S> struct BranchRow {
  Force<S> dFdq, dFdv, F;  // dFdq seen from the joints before k's: the force of the subtree turns with dof k
  Vec3<S> g;
  S diagonal_q, diagonal_v;

  template <class R> ENGRAM_INLINE BranchRow(const RbdData<R, S>& d, const BranchDerivatives<R, S>& b, int k) {
    const int i = kTree<R>.joint[k];
    const Motion<S>& J = d.J[k];
    dFdv = b.C[i].times_add(J.ang, d.Yc[i] * b.dAdv[k]);
    dFdq = b.C[i].times_add(b.dVdq[k], d.Yc[i] * b.dAdq[k]);
    diagonal_v = dot(J, dFdv);
    diagonal_q = dot(J, dFdq);
    if (R::parent[i] >= 0) dFdq = cross_add(J, b.f[i], dFdq);
    F = d.Yc[i] * J;
    g = b.C[i].transposed_times(J);
  }
};

// The entries of d tau / d q and d tau / d v whose dofs lie on one branch; the others are zero and are not written.
template <class R, class S> inline void rbd_rnea_derivatives_on_branches(const RbdData<R, S>& d, Mat<S, R::nv, R::nv>& dtau_dq,
                                                                         Mat<S, R::nv, R::nv>& dtau_dv) {
  constexpr const Tree<R>& tree = kTree<R>;
  const BranchDerivatives<R, S> b(d);
  for (int k = R::nv - 1; k >= 0; --k) {
    const BranchRow<S> row(d, b, k);
    dtau_dv(k, k) = row.diagonal_v;
    dtau_dq(k, k) = row.diagonal_q;
    for (int e = tree.first[k]; e < tree.first[k] + tree.depth[k]; ++e) {
      const int j = tree.ancestor[e];
      dtau_dv(j, k) = dot(d.J[j], row.dFdv);
      dtau_dq(j, k) = dot(d.J[j], row.dFdq);
      dtau_dv(k, j) = dot_add(row.g, d.J[j].ang, dot(b.dAdv[j], row.F));
      dtau_dq(k, j) = dot_add(row.g, b.dVdq[j], dot(b.dAdq[j], row.F));
    }
  }
}

// d tau / d q and d tau / d v (nv x nv each) of rbd_rnea, after it and rbd_composite_inertias.
template <class R, class S>
inline void rbd_rnea_derivatives(const RbdData<R, S>& d, Mat<S, R::nv, R::nv>& dtau_dq, Mat<S, R::nv, R::nv>& dtau_dv) {
  dtau_dq.setZero();
  dtau_dv.setZero();
  rbd_rnea_derivatives_on_branches(d, dtau_dq, dtau_dv);
}

// d.A and d.f, left at zero joint acceleration by rbd_forward_dynamics, at joint accelerations a. Both are affine: add J a and Y J a.
template <class R, class S> inline void rbd_accelerate(const S* a, RbdData<R, S>& d) {
  Motion<S> dA[R::nj];
  for (int i = 0; i < R::nj; ++i) {
    const int p = R::parent[i];
    dA[i] = rbd_add_joint_motion(d, i, a, p < 0 ? Motion<S>::zero() : dA[p]);
    d.A[i] += dA[i];
    d.f[i] = mul_add(d.Y[i], dA[i], d.f[i]);
  }
}

// d a / d q, d a / d v and M^-1 = d a / d tau (nv x nv each):  d a = M^-1 (d tau - dtau_dq dq - dtau_dv dv).
// Call right after rbd_forward_dynamics(q, v, tau, d, a); overwrites d.A and d.f with their values at a. No heap; cannot fail.
template <class R, class S> inline void rbd_forward_derivatives(RbdData<R, S>& d, const S* a, Mat<S, R::nv, R::nv>& da_dq,
                                                                Mat<S, R::nv, R::nv>& da_dv, Mat<S, R::nv, R::nv>& Minv) {
  rbd_accelerate(a, d);
  rbd_rnea_derivatives_on_branches(d, da_dq, da_dv);
  S minus_D_inv[R::nv];
  for (int k = 0; k < R::nv; ++k) minus_D_inv[k] = -d.D_inv[k];
  rbd_factor_solve(d.L, minus_D_inv, da_dq);
  rbd_factor_solve(d.L, minus_D_inv, da_dv);
  rbd_factor_inverse(d.L, d.D_inv, Minv);
}

// d g / d q (nv x nv) after rbd_gravity, whose d.Yc (mass and moment of the subtrees) it reads: rbd_rnea_derivatives at v = a = 0.
template <class R, class S> inline void rbd_gravity_derivatives(const RbdData<R, S>& d, Mat<S, R::nv, R::nv>& dg_dq) {
  constexpr const Tree<R>& tree = kTree<R>;
  const Vec3<S> up = -constant3<S>(R::gravity);
  Vec3<S> dA[R::nv];  // dAdq_k = (up x w_k, 0)
  for (int k = 0; k < R::nv; ++k) dA[k] = cross(up, d.J[k].ang);
  dg_dq.setZero();
  for (int k = R::nv - 1; k >= 0; --k) {
    const int i = tree.joint[k];
    const Motion<S>& J = d.J[k];
    const Inertia<S>& Y = d.Yc[i];
    const Force<S> f = {up * Y.mass, cross(Y.moment, up)};
    const Force<S> dF = {dA[k] * Y.mass, cross(Y.moment, dA[k])};
    const Force<S> dF_turned = R::parent[i] < 0 ? dF : cross_add(J, f, dF);
    const Vec3<S> F = cross_add<S>(J.ang, Y.moment, J.lin * Y.mass);
    dg_dq(k, k) = dot(J, dF);
    for (int e = tree.first[k]; e < tree.first[k] + tree.depth[k]; ++e) {
      const int j = tree.ancestor[e];
      dg_dq(j, k) = dot(d.J[j], dF_turned);
      dg_dq(k, j) = dot(F, dA[j]);
    }
  }
}

}  // namespace engram
#endif  // CONTROLLER_RBD_RBD_DERIVATIVES_H_
