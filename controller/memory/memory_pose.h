// A pose as six numbers, for tables over goals: p_WT [m] and three angles [rad] with
//
//   R_WT = Ry(beta) Rx(alpha) Rz(gamma),   z axis = (sin beta cos alpha, -sin alpha, cos beta cos alpha)
//
// beta turns the approach axis z from up over forward to down, alpha leans it sideways, gamma is the roll about it. Smooth wherever the
// approach axis is not along y.
#ifndef CONTROLLER_MEMORY_MEMORY_POSE_H_
#define CONTROLLER_MEMORY_MEMORY_POSE_H_

#include "controller/ocp/ocp_reach.h"

#include <cmath>

namespace engram {

inline constexpr int kMemoryPose = 6;

// angles (3) = (beta, alpha, gamma)
template <class S> Mat3<S> memory_pose_rotation(const S* angles) {
  S s[3], c[3];
  for (int i = 0; i < 3; ++i) sincos(angles[i], s[i], c[i]);
  const auto &[sb, sa, sg] = s;
  const auto &[cb, ca, cg] = c;
  Mat3<S> R;
  R(0, 0) = cb * cg + sb * sa * sg, R(0, 1) = sb * sa * cg - cb * sg, R(0, 2) = sb * ca;
  R(1, 0) = ca * sg, R(1, 1) = ca * cg, R(1, 2) = -sa;
  R(2, 0) = cb * sa * sg - sb * cg, R(2, 1) = sb * sg + cb * sa * cg, R(2, 2) = cb * ca;
  return R;
}

// x (6) of a goal; beta and gamma in [-pi/2, 3 pi/2), so that neither forward, down nor a roll by 0 or pi lies at the seam.
inline void memory_pose(const ReachTarget& goal, double* x) {
  constexpr double kPi = 3.14159265358979323846;
  const auto from_quarter = [](double angle) { return angle < -0.5 * kPi ? angle + 2 * kPi : angle; };
  const double* const R = goal.R;
  for (int i = 0; i < 3; ++i) x[i] = goal.p[i];
  x[3] = from_quarter(std::atan2(R[2], R[8]));
  x[4] = std::asin(std::fmax(-1.0, std::fmin(1.0, -R[5])));
  x[5] = from_quarter(std::atan2(R[3], R[4]));
}

}  // namespace engram
#endif  // CONTROLLER_MEMORY_MEMORY_POSE_H_
