// The anchor problems of the benches, stated for our solver as bench/peers states them for Crocoddyl.
#ifndef BENCH_PROBLEMS_H_
#define BENCH_PROBLEMS_H_

#include "controller/fddp/fddp.h"
#include "controller/ocp/ocp.h"
#include "controller/ocp/ocp_frame.h"
#include "controller/ocp/ocp_regularization.h"
#include "tables/panda/robot.h"

namespace engram::bench {

// Panda reach of Crocoddyl's arm example: hand placement, state and torque regularization, 10 ms knots.
using Arm = Ocp<robots::Panda, FramePlacementTerm<robots::Panda, robots::Panda::kHandTcp>, StateTerm<robots::Panda>,
                ControlTerm<robots::Panda, false>>;

// T knots from rest at q0; T <= N.
template <int N> void arm_horizon(int T, const double* q0, Horizon<Arm, N>& h) {
  constexpr double dt = 1e-2, target[3] = {0.5, 0.3, 0.4};
  h = {};
  h.n = T;
  for (int i = 0; i < Arm::nq; ++i) h.x0[i] = q0[i];
  for (int k = 0; k <= T; ++k) {
    auto& knot = h.knot[k];
    const bool terminal = k == T;
    knot.dt = terminal ? 0.0 : dt;
    knot.placement_w = terminal ? 1e3 : 1.0 * dt;
    for (int i = 0; i < 3; ++i) knot.placement_p[i] = target[i];
    for (int i = 0; i < 3; ++i) knot.placement_R[4 * i] = i == 0 ? 1.0 : -1.0;
    for (int i = 0; i < Arm::ndx; ++i) knot.state_w[i] = terminal ? 0.0 : 1e-1 * dt;
    for (int i = 0; i < Arm::nx; ++i) knot.state_ref[i] = h.x0[i];
    knot.control_w = terminal ? 0.0 : 1e-1 * dt;
  }
}

// Cold start: stand still at x0 under the gravity torque.
template <int N> void arm_cold_start(const Horizon<Arm, N>& h, FddpSolution<Arm, N>& s) {
  RbdData<robots::Panda, Real> d;
  Real g[Arm::nv];
  rbd_kinematics<robots::Panda>(h.x0, d);
  rbd_inertias<robots::Panda>(d);
  rbd_gravity<robots::Panda>(d, g);
  for (int k = 0; k <= h.n; ++k)
    for (int i = 0; i < Arm::nx; ++i) s.x[k][i] = h.x0[i];
  for (int k = 0; k < h.n; ++k)
    for (int i = 0; i < Arm::nu; ++i) s.u[k][i] = g[i];
}

}  // namespace engram::bench
#endif  // BENCH_PROBLEMS_H_
