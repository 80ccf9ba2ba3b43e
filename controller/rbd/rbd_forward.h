// Forward dynamics that leaves behind what its derivatives need: bias forces by Newton-Euler, M by CRBA, branch-sparse M = L' D L.
#ifndef CONTROLLER_RBD_RBD_FORWARD_H_
#define CONTROLLER_RBD_RBD_FORWARD_H_

#include "controller/rbd/rbd_crba.h"
#include "controller/rbd/rbd_factor.h"
#include "controller/rbd/rbd_rnea.h"

namespace engram {

// Joint accelerations a (nv) = M^-1 (tau - b) for q (nq), v (nv), joint forces tau (nv) [N, N m].
// Overwrites all of d (A and f with their values at zero joint acceleration). No heap; cannot fail for positive definite M.
template <class R, class S> inline void rbd_forward_dynamics(const S* q, const S* v, const S* tau, RbdData<R, S>& d, S* a) {
  rbd_kinematics(q, d);
  rbd_velocity(v, d);
  rbd_inertias(d);
  rbd_body_forces<R, S>(nullptr, d);
  rbd_project_forces(d, a);
  for (int k = 0; k < R::nv; ++k) a[k] = tau[k] - a[k];
  rbd_composite_inertias(d);
  rbd_crba_lower(d, d.L);
  rbd_factor(d.L, d.D_inv);
  rbd_factor_solve(d.L, d.D_inv, a);
}

}  // namespace engram
#endif  // CONTROLLER_RBD_RBD_FORWARD_H_
