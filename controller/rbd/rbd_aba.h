// Forward dynamics by the articulated body algorithm: a = M^-1 (tau - b), without M.
// Source: Featherstone, Rigid Body Dynamics Algorithms (2008), section 7.3, in world coordinates; a free joint is eliminated dof by dof.
#ifndef CONTROLLER_RBD_RBD_ABA_H_
#define CONTROLLER_RBD_RBD_ABA_H_

#include "controller/rbd/rbd_kinematics.h"

namespace engram {

// Articulated inertia [A B; B' C]: force = A u + B w, moment = B' u + C w; A and C symmetric (xx xy xz yy yz zz).
template <class S> struct ArticulatedInertia {
  S A[6], C[6];
  Mat3<S> B;

  ArticulatedInertia() = default;
  ENGRAM_INLINE explicit ArticulatedInertia(const Inertia<S>& Y) {
    A[0] = A[3] = A[5] = Y.mass;
    A[1] = A[2] = A[4] = S(0.0);
    B = skew<S>(-Y.moment);
    for (int i = 0; i < 6; ++i) C[i] = Y.I[i];
  }
  ENGRAM_INLINE ArticulatedInertia& operator+=(const ArticulatedInertia& b) {
    for (int i = 0; i < 6; ++i) {
      A[i] += b.A[i];
      C[i] += b.C[i];
    }
    B += b.B;
    return *this;
  }
  ENGRAM_INLINE friend Force<S> operator*(const ArticulatedInertia& I, const Motion<S>& a) {
    return {mul_symmetric_add(I.A, a.lin, mul(I.B, a.ang)), mul_symmetric_add(I.C, a.ang, mul_transposed(I.B, a.lin))};
  }
  // I -= s U U'
  ENGRAM_INLINE void downdate(const Force<S>& U, S s) {
    const Vec3<S> f = U.lin * s, n = U.ang * s;
    for (int i = 0, e = 0; i < 3; ++i) {
      for (int j = i; j < 3; ++j, ++e) {
        A[e] = nmadd(f[i], U.lin[j], A[e]);
        C[e] = nmadd(n[i], U.ang[j], C[e]);
      }
      for (int j = 0; j < 3; ++j) B(i, j) = nmadd(f[i], U.ang[j], B(i, j));
    }
  }
};

// Joint accelerations a (nv) for q (nq), v (nv), joint forces tau (nv) [N, N m].
// Overwrites d up to Y. No heap; cannot fail for a robot with positive definite M.
template <class R, class S> inline void rbd_aba(const S* q, const S* v, const S* tau, RbdData<R, S>& d, S* a) {
  ArticulatedInertia<S> IA[R::nj];
  Force<S> pA[R::nj];  // articulated bias force
  Motion<S> A[R::nj];  // V_parent x V_i, then the acceleration
  Force<S> U[R::nv];   // IA J
  S D_inv[R::nv], u[R::nv];

  rbd_kinematics(q, d);
  rbd_velocity(v, d);
  rbd_inertias(d);
  for (int i = 0; i < R::nj; ++i) {
    const int p = R::parent[i];
    A[i] = p < 0 ? Motion<S>::zero() : cross(d.V[p], d.V[i]);
    IA[i] = ArticulatedInertia<S>(d.Y[i]);
    pA[i] = cross(d.V[i], d.Y[i] * d.V[i]);
  }
  for (int i = R::nj - 1; i >= 0; --i) {
    for (int k = kTree<R>.last[i]; k >= R::iv[i]; --k) {
      // U = IA J,  D = J . U,  u = tau - J . pA
      U[k] = IA[i] * d.J[k];
      D_inv[k] = 1.0 / (dot(d.J[k], U[k]) + S(R::armature[k]));
      u[k] = (tau[k] - dot(d.J[k], pA[i])) * D_inv[k];
      // IA - U U' / D,  pA + U u / D
      IA[i].downdate(U[k], D_inv[k]);
      pA[i] = madd(U[k], u[k], pA[i]);
    }
    if (const int p = R::parent[i]; p >= 0) {
      pA[p] += pA[i] + IA[i] * A[i];
      IA[p] += IA[i];
    }
  }
  for (int i = 0; i < R::nj; ++i) {
    const int p = R::parent[i];
    A[i] += p < 0 ? rbd_gravity_acceleration<R, S>() : A[p];
    for (int k = R::iv[i]; k <= kTree<R>.last[i]; ++k) {
      a[k] = nmadd(dot(A[i], U[k]), D_inv[k], u[k]);
      A[i] = madd(d.J[k], a[k], A[i]);
    }
  }
}

}  // namespace engram
#endif  // CONTROLLER_RBD_RBD_ABA_H_
