// Inverse kinematics to one constant pose, in place: what the memory asks for.
#ifndef CONTROLLER_IK_IK_POSE_H_
#define CONTROLLER_IK_IK_POSE_H_

#include "controller/ik/ik_reach.h"

namespace engram {

inline constexpr double kIkMargin = 0.05;  // [rad] kept to the joint limits

// From the posture q (nq), in place, to the nearest one whose frame has the position target.p [m] and rotation target.R (row-major) in
// the world. Returns |r| of ik_reach at the q it leaves. d is scratch.
template <class R, int frame, class S, class Target>
S ik_pose(const Target& target, S* q, RbdData<R, S>& d, int iterations = IkOptions{}.iterations) {
  IkOptions options;
  options.iterations = iterations;
  options.margin = kIkMargin;
  S q_found[R::nq], residual;
  ik_reach<R>(frame, constant33<S>(target.R), constant3<S>(target.p), q, options, d, q_found, residual);
  for (int i = 0; i < R::nq; ++i) q[i] = q_found[i];
  return residual;
}

}  // namespace engram
#endif  // CONTROLLER_IK_IK_POSE_H_
