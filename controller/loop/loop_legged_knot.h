// One knot of a robot on legs: what its terms weigh, about the references of its moment. Of a walk under way (loop_legged.h) and of steps
// from rest to rest (loop_steps.h); C as there.
//
// Postures are about robot.toml's, turned by the heading; torques about those that carry the weight. A foot weighs while it swings and,
// `landing` times more, in the first knot of its stance; in the terminal knot never: that knot has no contact forces, and a swing
// reference at the end of the horizon would pull at a foot that stands before the plan gets there.
#ifndef CONTROLLER_LOOP_LOOP_LEGGED_KNOT_H_
#define CONTROLLER_LOOP_LOOP_LEGGED_KNOT_H_

#include "controller/loop/loop_gait.h"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace engram {

struct LeggedReference {
  const double* base;         // where it is (3) [m]: it weighs nothing
  double yaw, turn;           // heading [rad], and its rate [rad/s]
  double com[3], velocity[3]; // centre of mass [m, m/s], world axes
  const double* torque;       // (nu) [N m]
};

// A knot that lasts dt [s]; the terminal one weighs weights.terminal instead. All but the terms of feet, and the phase.
template <class C, class Knot> void legged_knot(const LeggedReference& ref, double dt, bool terminal, Knot& k) {
  using R = typename C::P::R;
  using W = typename C::Task;
  const double weight = terminal ? W::weights_terminal : dt;
  const double velocity = terminal ? W::weights_terminal * W::weights_terminal_velocity : dt;
  const double c = std::cos(ref.yaw), s = std::sin(ref.yaw);
  k.dt = terminal ? 0.0 : dt;
  std::memcpy(k.state_ref, R::q_home, sizeof(R::q_home));
  for (int i = 0; i < 3; ++i) k.state_ref[i] = ref.base[i];
  k.state_ref[3] = k.state_ref[4] = 0.0;
  k.state_ref[5] = std::sin(0.5 * ref.yaw);
  k.state_ref[6] = std::cos(0.5 * ref.yaw);
  for (int i = 0; i < R::nv; ++i) {
    const bool leg = i < 6 + C::legs;
    k.state_ref[R::nq + i] = 0.0;
    k.state_w[i] = weight * (i < 3 ? 0.0 : i < 6 ? W::weights_orientation : W::weights_posture[leg ? 0 : 1]);
    k.state_w[R::nv + i] = velocity * (i < 6 ? W::weights_base_velocity : W::weights_velocity[leg ? 0 : 1]);
  }
  k.state_ref[R::nq] = c * ref.velocity[0] + s * ref.velocity[1];  // world axes, into the body's
  k.state_ref[R::nq + 1] = -s * ref.velocity[0] + c * ref.velocity[1];
  k.state_ref[R::nq + 2] = ref.velocity[2];
  k.state_ref[R::nq + 5] = ref.turn;
  for (int i = 0; i < 3; ++i) {
    k.com_ref[i] = ref.com[i];
    k.com_w[i] = weight * W::weights_com[i];
  }
  for (int i = 0; i < R::nu; ++i) {
    const double share = std::fmin(1.0, R::u_max[i] / W::weights_torque_scale);
    k.torque_w[i] = terminal ? 0.0 : dt * W::weights_torque / (share * share);
    k.torque_ref[i] = ref.torque[i];
  }
  k.limit_w_q = dt * W::weights_limit_q;
}

// The terms of foot c, which is or shall be at `at`. cone: weight of its wrench outside the cone.
template <class C, int c, class Knot>
void legged_foot(const Placement& at, bool swings, bool lands, double cone, double dt, bool terminal, Knot& k) {
  using W = typename C::Task;
  C::cone(static_cast<typename C::template Cone<c>::template Param<double>&>(k), terminal || swings ? 0.0 : dt * cone, at.yaw);
  const double weight = terminal ? 0.0 : swings ? W::gait_swing_weight : lands ? W::gait_swing_weight * W::gait_landing : 0.0;
  C::swing(static_cast<typename C::template Swing<c>::template Param<double>&>(k), dt * weight, at);
}

}  // namespace engram
#endif  // CONTROLLER_LOOP_LOOP_LEGGED_KNOT_H_
