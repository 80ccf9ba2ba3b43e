// Named frames, points and collision spheres of the robot: placements, Jacobians, velocities. All after rbd_kinematics.
#ifndef CONTROLLER_RBD_RBD_FRAMES_H_
#define CONTROLLER_RBD_RBD_FRAMES_H_

#include "controller/rbd/rbd_kinematics.h"

namespace engram {

// Placement of frame F in the world: axes R_WF, origin p_WF [m].
template <class R, class S> inline void rbd_frame_placement(const RbdData<R, S>& d, int frame, Mat3<S>& R_WF, Vec3<S>& p_WF) {
  const int i = R::frame_joint[frame];
  p_WF = mul_add(d.R_WJ[i], constant3<S>(R::p_JF[frame]), d.p_WJ[i]);
  R_WF = matmul(d.R_WJ[i], constant33<S>(R::R_JF[frame]));
}

template <class S> inline S motion_entry(const Motion<S>& m, int row) { return row < 3 ? m.lin[row] : m.ang[row - 3]; }

// m moved from the world origin to the point p.
template <class S> inline Motion<S> moved_to(const Motion<S>& m, const Vec3<S>& p) { return {cross_add(m.ang, p, m.lin), m.ang}; }

// How a spatial quantity of a frame is written down: at its origin in its own axes, at the world's origin in the world's axes, or at
// its origin in the world's axes (Pinocchio's LOCAL, WORLD, LOCAL_WORLD_ALIGNED).
enum class Axes : uint8_t { kLocal, kWorld, kLocalWorldAligned };

template <Axes axes, class S> inline Motion<S> seen_from(const Motion<S>& m, const Mat3<S>& R_WF, const Vec3<S>& p_WF) {
  if constexpr (axes == Axes::kWorld) return m;
  const Motion<S> at = moved_to(m, p_WF);
  if constexpr (axes == Axes::kLocalWorldAligned) return at;
  return {mul_transposed(R_WF, at.lin), mul_transposed(R_WF, at.ang)};
}

// Jacobian (3 x nv) of a point p_W fixed to joint i: its velocity in world axes is J v.
template <class R, class S>
inline void rbd_point_jacobian(const RbdData<R, S>& d, int i, const Vec3<S>& p_W, Mat<S, 3, R::nv>& J) {
  J.setZero();
  for (int k = kTree<R>.last[i]; k >= 0; k = kTree<R>.parent[k]) {
    J.col(k) = cross_add(d.J[k].ang, p_W, d.J[k].lin);
  }
}

// Jacobian (6 x nv, linear first) of a frame of joint i with origin p_WF: velocity of its origin and angular velocity, in world axes
// (Pinocchio's LOCAL_WORLD_ALIGNED).
template <class R, class S>
inline void rbd_frame_jacobian(const RbdData<R, S>& d, int frame, const Vec3<S>& p_WF, Mat<S, 6, R::nv>& J) {
  const int i = R::frame_joint[frame];
  J.setZero();
  for (int k = kTree<R>.last[i]; k >= 0; k = kTree<R>.parent[k]) {
    J.template block<3, 1>(0, k) = cross_add(d.J[k].ang, p_WF, d.J[k].lin);
    J.template block<3, 1>(3, k) = d.J[k].ang;
  }
}

// The same in the axes of the frame (Pinocchio's LOCAL).
template <class R, class S> inline void rbd_frame_jacobian_local(const RbdData<R, S>& d, int frame, const Mat3<S>& R_WF,
                                                                 const Vec3<S>& p_WF, Mat<S, 6, R::nv>& J) {
  const int i = R::frame_joint[frame];
  J.setZero();
  for (int k = kTree<R>.last[i]; k >= 0; k = kTree<R>.parent[k]) {
    J.template block<3, 1>(0, k) = mul_transposed<S>(R_WF, cross_add(d.J[k].ang, p_WF, d.J[k].lin));
    J.template block<3, 1>(3, k) = mul_transposed<S>(R_WF, d.J[k].ang);
  }
}

// Velocity [m/s] in world axes of the point p_W fixed to joint i. After rbd_velocity.
template <class R, class S> inline Vec3<S> rbd_point_velocity(const RbdData<R, S>& d, int i, const Vec3<S>& p_W) {
  return cross_add(d.V[i].ang, p_W, d.V[i].lin);
}

// Centre of collision sphere s of the set `Spheres` in the world [m].
template <class R, class Spheres = R, class S> inline Vec3<S> rbd_sphere_position(const RbdData<R, S>& d, int s) {
  const int i = Spheres::sphere_joint[s];
  return mul_add(d.R_WJ[i], constant3<S>(Spheres::p_JS[s]), d.p_WJ[i]);
}

}  // namespace engram
#endif  // CONTROLLER_RBD_RBD_FRAMES_H_
