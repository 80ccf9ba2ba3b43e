// Torques of a robot on its contacts: those that hold it at rest, or those that move it along.
//
//   g = B u + J' lambda, base rows:   J_b' lambda = g_b,   lambda = W J_b (J_b' W J_b + eps 1)^-1 g_b        least lambda' W^-1 lambda
//   driven rows:                      u = g_u - J_u' lambda
//
// g: gravity, or M a + b. W = 1 for forces and kLever^2 for moments. Where the contacts cannot carry the weight (two points under a body
// that would tip about their line), eps leaves what they cannot do undone.
#ifndef CONTROLLER_OCP_OCP_STANCE_H_
#define CONTROLLER_OCP_OCP_STANCE_H_

#include "controller/rbd/rbd_contact.h"
#include "controller/rbd/rbd_rnea.h"

#include <Eigen/Cholesky>

namespace engram {

// u (nu) [N m] from g (nv), which is overwritten, on the contacts of the mask `active`; d holds the kinematics. P: a problem with contacts
// whose controls drive the last dofs.
template <class P> void torques_on_contacts(const RbdData<typename P::R, Real>& d, unsigned active, Real (&g)[P::nv], Real* u) {
  using C = typename P::Contacts;
  constexpr const ContactTree<C>& tree = kContactTree<C>;
  constexpr Real kLever2 = 0.1 * 0.1;  // m^2
  constexpr int first = P::nv - P::nu;
  static_assert(P::kFreeBase, "a robot that stands");
  ContactData<C, Real> cd;
  rbd_contact_jacobians<C>(d, active, cd);
  const auto weight = [](int row) { return row < 3 ? 1.0 : kLever2; };
  Eigen::Matrix<Real, 6, 6> A = Eigen::Matrix<Real, 6, 6>::Zero();
  Eigen::Matrix<Real, 6, 1> y;
  for (int i = 0; i < 6; ++i) y[i] = g[i];
  for (int c = 0; c < C::n; ++c)
    for (int r = 0; contact_active(active, c) && r < tree.rows[c]; ++r)
      for (int i = 0; i < 6; ++i)  // dof i of the base is dof i of every path
        for (int j = 0; j < 6; ++j) A(i, j) += weight(r) * motion_entry(cd.J[c][i], r) * motion_entry(cd.J[c][j], r);
  A.diagonal().array() += 1e-9 * (A.trace() + 1.0);
  y = A.llt().solve(y);
  for (int c = 0; c < C::n; ++c)
    for (int r = 0; contact_active(active, c) && r < tree.rows[c]; ++r) {
      Real lambda = 0.0;
      for (int i = 0; i < 6; ++i) lambda += weight(r) * motion_entry(cd.J[c][i], r) * y[i];
      for (int a = 0; a < tree.path_n[c]; ++a) g[tree.path[c][a]] -= motion_entry(cd.J[c][a], r) * lambda;
    }
  for (int i = 0; i < P::nu; ++i) u[i] = g[first + i];
}

// At rest in the posture q (nq).
template <class P> void stance_torques(const Real* q, unsigned active, Real* u) {
  RbdData<typename P::R, Real> d;
  Real g[P::nv];
  rbd_kinematics<typename P::R>(q, d);
  rbd_gravity<typename P::R>(d, g);
  torques_on_contacts<P>(d, active, g, u);
}

// At (q, v) (nq, nv) with the acceleration a (nv).
template <class P> void inverse_dynamics_on_contacts(const Real* q, const Real* v, const Real* a, unsigned active, Real* u) {
  RbdData<typename P::R, Real> d;
  Real g[P::nv];
  rbd_rnea<typename P::R>(q, v, a, d, g);
  torques_on_contacts<P>(d, active, g, u);
}

}  // namespace engram
#endif  // CONTROLLER_OCP_OCP_STANCE_H_
