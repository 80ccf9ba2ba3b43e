// Impacts: the velocity jumps so that the frames that touch down come to rest.
//
//   M (v+ - v) = J' Lambda,    J v+ = 0
//
// Source: Budhiraja et al. (Humanoids 2018), section III. With U, G of rbd_contact.h: Lambda = -G^-1 J v, v+ - v = L^-1 U Lambda.
#ifndef CONTROLLER_RBD_RBD_IMPULSE_H_
#define CONTROLLER_RBD_RBD_IMPULSE_H_

#include "controller/rbd/rbd_contact_derivatives.h"

namespace engram {

// The same robot without gravity: an impact is too short for it.
template <class R> struct Weightless : R {
  static constexpr double gravity[3] = {0.0, 0.0, 0.0};
};

// Jump dv (nv) = v+ - v of the velocity and impulses cd.lambda [N s, N m s] for q (nq), v (nv).
// Overwrites d (V with the velocities before the impact) and cd. No heap.
template <class C, class R, class S>
inline void rbd_impulse(const S* q, const S* v, unsigned active, RbdData<R, S>& d, ContactData<C, S>& cd, S (&dv)[R::nv]) {
  constexpr const ContactTree<C>& tree = kContactTree<C>;
  rbd_kinematics(q, d);
  rbd_velocity(v, d);
  rbd_inertias(d);
  rbd_composite_inertias(d);
  rbd_crba_lower(d, d.L);
  rbd_factor<R>(d.L, d.D_inv);
  rbd_contact_jacobians(d, active, cd);
  rbd_contact_factor(d, active, cd);
  for (int c = 0; c < C::n; ++c) {
    if (!contact_active(active, c)) continue;
    const Motion<S> V = moved_to(d.V[tree.joint[c]], cd.p_WF[c]);
    for (int r = 0; r < tree.rows[c]; ++r) cd.a0[tree.first[c] + r] = motion_entry(V, r);
  }
  for (S& s : dv) s = 0.0;
  rbd_contact_forces(d, active, cd, dv);
  rbd_solve_lower(d, dv);
}

// Derivatives of the jump, in the form of rbd_contact_derivatives.h: da = L^-1 (U dLambda - D^-1 X), dLambda = G^-1 B. After rbd_impulse.
template <class C, class R, int nu, class S>
inline void rbd_impulse_derivatives(const S* q, const S* v, const S* dv, unsigned active, const RbdData<R, S>& d, const ContactData<C, S>& cd,
                                    ContactDerivatives<C, nu, S>& out) {
  using W = Weightless<R>;
  constexpr const ContactTree<C>& tree = kContactTree<C>;
  RbdData<W, S> w;  // the jump as an acceleration from rest
  for (int i = 0; i < R::nj; ++i) w.V[i] = Motion<S>::zero();
  rbd_kinematics(q, w);
  rbd_inertias(w);
  rbd_body_forces(dv, w);
  rbd_composite_inertias(w);
  rbd_take_contact_forces(active, cd, w);
  rbd_rnea_derivatives(w, out.Xq, out.Xv);
  rbd_solve_upper_related(d, out.Xq);
  out.Xv.setZero();
  for (auto& row : out.Xu)
    for (S& s : row) s = 0.0;

  S v_after[R::nv];
  for (int k = 0; k < R::nv; ++k) v_after[k] = v[k] + dv[k];
  rbd_velocity(v_after, w);
  int u_dof[nu];
  for (int& dof : u_dof) dof = 0;
  rbd_contact_right_sides(active, cd, u_dof, out, [&](int c, auto& dTq, auto& dTv) {
    for (int a = 0; a < tree.path_n[c]; ++a) {
      const int k = tree.path[c][a], parent = R::parent[kTree<R>.joint[k]];
      const Motion<S> dVdq = parent < 0 ? Motion<S>::zero() : moved_to(cross(w.V[parent], d.J[k]), cd.p_WF[c]);
      for (int r = 0; r < tree.rows[c]; ++r) {
        dTq[a][r] = motion_entry(dVdq, r);
        dTv[a][r] = motion_entry(cd.J[c][a], r);
      }
    }
  });
}

}  // namespace engram
#endif  // CONTROLLER_RBD_RBD_IMPULSE_H_
