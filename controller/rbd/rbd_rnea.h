// Inverse dynamics by recursive Newton-Euler: tau = M(q) a + b(q, v), armature included.
// Source: Featherstone, Rigid Body Dynamics Algorithms (2008), chapter 5, in world coordinates.
#ifndef CONTROLLER_RBD_RBD_RNEA_H_
#define CONTROLLER_RBD_RBD_RNEA_H_

#include "controller/rbd/rbd_kinematics.h"

namespace engram {

// d.A, d.f for the bodies' accelerations under joint accelerations a (nv), or zero if a is null:
//   A_i = A_parent + J_i a_i + V_parent x V_i,   A_world = -g
//   f_i = Y_i A_i + V_i x* Y_i V_i
// After rbd_velocity and rbd_inertias.
template <class R, class S> inline void rbd_body_forces(const S* a, RbdData<R, S>& d) {
  for (int i = 0; i < R::nj; ++i) {
    const int p = R::parent[i];
    Motion<S> A = p < 0 ? rbd_gravity_acceleration<R, S>() : cross_add(d.V[p], d.V[i], d.A[p]);
    if (a != nullptr) A = rbd_add_joint_motion(d, i, a, A);
    d.A[i] = A;
    d.f[i] = cross_add(d.V[i], d.Y[i] * d.V[i], d.Y[i] * A);
  }
}

// tau_k = J_k . (sum of f over the subtree of k); d.f is left as it is
template <class R, class S> inline void rbd_project_forces(const RbdData<R, S>& d, S* tau) {
  Force<S> f[R::nj];  // of the subtree
  for (int i = 0; i < R::nj; ++i) f[i] = d.f[i];
  for (int i = R::nj - 1; i >= 0; --i) {
    for (int k = R::iv[i]; k <= kTree<R>.last[i]; ++k) tau[k] = dot(d.J[k], f[i]);
    if (const int p = R::parent[i]; p >= 0) f[p] += f[i];
  }
}

// Joint forces tau (nv) [N, N m] for q (nq), v (nv), a (nv).
// Overwrites d up to f: rbd_rnea_derivatives may follow. No heap; cannot fail.
template <class R, class S> inline void rbd_rnea(const S* q, const S* v, const S* a, RbdData<R, S>& d, S* tau) {
  rbd_kinematics(q, d);
  rbd_velocity(v, d);
  rbd_inertias(d);
  rbd_body_forces(a, d);
  rbd_project_forces(d, tau);
  for (int k = 0; k < R::nv; ++k) tau[k] = madd(S(R::armature[k]), a[k], tau[k]);
}

// Gravity forces g(q) (nv): what holds the robot still. After rbd_kinematics.
//   g_k = J_k . (m (-g), mc x (-g)) of the subtree; rbd_gravity_derivatives may follow (d.Yc mass and moment are written)
template <class R, class S> inline void rbd_gravity(RbdData<R, S>& d, S* g) {
  const Vec3<S> up = -constant3<S>(R::gravity);
  for (int i = 0; i < R::nj; ++i) {
    const Vec3<S> c = mul_add(d.R_WJ[i], constant3<S>(R::com[i]), d.p_WJ[i]);
    d.Yc[i].mass = S(R::mass[i]);
    d.Yc[i].moment = c * S(R::mass[i]);
  }
  for (int i = R::nj - 1; i >= 0; --i) {
    const Force<S> f = {up * d.Yc[i].mass, cross(d.Yc[i].moment, up)};
    for (int k = R::iv[i]; k <= kTree<R>.last[i]; ++k) g[k] = dot(d.J[k], f);
    if (const int p = R::parent[i]; p >= 0) {
      d.Yc[p].mass += d.Yc[i].mass;
      d.Yc[p].moment += d.Yc[i].moment;
    }
  }
}

}  // namespace engram
#endif  // CONTROLLER_RBD_RBD_RNEA_H_
