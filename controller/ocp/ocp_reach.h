// The reach: bring a frame of an arm to a target pose among boxes. Constants T: tables/<robot>_<task>/task.h.
//
// Running cost of a knot (times dt): hand position and rotation, posture about q_home, velocity, torque about gravity, barriers on
// joint position, joint velocity and torque, collision of the robot's spheres with the world's boxes. Terminal: the same without
// torque and with heavy pose weights. Knots later than T::arrival_time after a jump weigh the pose T::arrival_factor times more:
// with constant weights a receding horizon may put the arrival off for ever.
#ifndef CONTROLLER_OCP_OCP_REACH_H_
#define CONTROLLER_OCP_OCP_REACH_H_

#include "controller/ocp/ocp.h"
#include "controller/ocp/ocp_frame.h"
#include "controller/ocp/ocp_limits.h"
#include "controller/ocp/ocp_obstacles.h"
#include "controller/ocp/ocp_regularization.h"

#include <cmath>

namespace engram {

template <class T>
using Reach = Ocp<typename T::Robot, FramePoseTerm<typename T::Robot, T::frame>, StateTerm<typename T::Robot>,
                  ControlTerm<typename T::Robot, true>, LimitTerm<typename T::Robot>, ObstacleTerm<typename T::Robot, BoxField<T>>>;

// Where the hand shall be: p_WT [m] and R_WT (row-major).
struct ReachTarget {
  Real p[3];
  Real R[9];
};

// task = (p_WT, quaternion x y z w); false if an entry is not finite or the quaternion is zero.
inline bool reach_target(const Real* task, ReachTarget& target) {
  Real norm2 = 0.0;
  for (int i = 3; i < 7; ++i) norm2 += task[i] * task[i];
  const Real norm = std::sqrt(norm2);
  if (!(norm > 1e-6) || !std::isfinite(norm + task[0] + task[1] + task[2])) return false;
  Real quat[4];
  for (int i = 0; i < 4; ++i) quat[i] = task[3 + i] / norm;
  const Mat3<Real> R = rotation_of(quat);
  for (int i = 0; i < 3; ++i) target.p[i] = task[i];
  for (int i = 0; i < 9; ++i) target.R[i] = R(i / 3, i % 3);
  return true;
}

// Parameters of a knot of length dt [s] whose time is since_jump [s] after the target jumped. dt = 0: the terminal knot.
template <class T> void reach_knot(const ReachTarget& target, Real dt, Real since_jump, typename Reach<T>::template Knot<Real>& k) {
  using R = typename T::Robot;
  const bool end = dt == 0.0;
  const Real urgency = since_jump > T::arrival_time ? T::arrival_factor : 1.0;
  k.dt = dt;
  k.pose_w_p = end ? T::end_position : dt * urgency * T::run_position;
  k.pose_w_R = end ? T::end_rotation : dt * urgency * T::run_rotation;
  for (int i = 0; i < 3; ++i) k.pose_p[i] = target.p[i];
  for (int i = 0; i < 9; ++i) k.pose_R[i] = target.R[i];
  for (int i = 0; i < R::nv; ++i) {
    k.state_w[i] = end ? T::end_posture : dt * T::run_posture;
    k.state_w[R::nv + i] = end ? T::end_velocity : dt * T::run_velocity;
    k.state_ref[R::nq + i] = 0.0;
  }
  for (int i = 0; i < R::nq; ++i) k.state_ref[i] = R::q_home[i];
  k.control_w = end ? 0.0 : dt * T::run_torque;
  k.limit_w_q = end ? T::end_joint_limit : dt * T::run_joint_limit;
  k.limit_w_v = end ? 0.0 : dt * T::run_velocity_limit;
  k.limit_w_u = end ? 0.0 : dt * T::run_torque_limit;
  k.limit_margin_q = T::margin_joint;
  k.limit_margin_v = T::margin_velocity;
  k.obstacle_w = end ? T::end_collision : dt * T::run_collision;
  k.obstacle_margin = T::margin_collision;
}

// Smallest distance [m] between a collision sphere and a box at q (nq); negative in collision.
template <class T, class S> S reach_clearance(const S* q) {
  using R = typename T::Robot;
  RbdData<R, S> d;
  rbd_kinematics(q, d);
  S least = 1e3;
  for (int s = 0; s < R::nsphere; ++s) {
    const Vec3<S> center = rbd_sphere_position(d, s);
    for (int o = 0; o < T::nbox; ++o) {
      if (BoxField<T>::far(o, center, least + S(R::sphere_radius[s]))) continue;
      Vec3<S> gradient;
      least = min(least, BoxField<T>::distance(o, center, gradient) - S(R::sphere_radius[s]));
    }
  }
  return least;
}

// Pose of the hand at q.
template <class T, class S> void reach_hand(const S* q, Mat3<S>& R_WH, Vec3<S>& p_WH) {
  RbdData<typename T::Robot, S> d;
  rbd_kinematics(q, d);
  rbd_frame_placement(d, T::frame, R_WH, p_WH);
}

}  // namespace engram
#endif  // CONTROLLER_OCP_OCP_REACH_H_
