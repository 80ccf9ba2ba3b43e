// The controller's inverse kinematics as a refiner of the studies' postures: Gauss-Newton on the pose alone, obstacles unseen.
#ifndef CODEGEN_OFFLINE_STUDY_IK_H_
#define CODEGEN_OFFLINE_STUDY_IK_H_

#include "controller/ik/ik_reach.h"

#include <algorithm>
#include <cstddef>

namespace engram::offline {

// The rotation next to R_WF whose x axis is vertical, up or down, whichever is nearer: by the shortest turn.
//   a = R_WF e_x,  b = +-e_z,  v = a x b:   (1 + [v] + [v]^2 / (1 + a . b)) R_WF
template <class S> Mat3<S> level(const Mat3<S>& R_WF) {
  const Vec3<S> a = R_WF.column(0), b(0.0, 0.0, select(a[2] < S(0.0), S(-1.0), S(1.0)));
  const Vec3<S> v = cross<S>(a, b);
  const S share = 1.0 / (1.0 + dot<S>(a, b));
  Mat3<S> R;
  for (int j = 0; j < 3; ++j) {
    const Vec3<S> column = R_WF.column(j), once = cross<S>(v, column), twice = cross<S>(v, once);
    for (int i = 0; i < 3; ++i) R(i, j) = column[i] + once[i] + twice[i] * share;
  }
  return R;
}

// Moves the postures of m points x = (target p [m], q [rad]) to the target, in place. Setup M: Robot, frame, and pose(), the rotation that
// is asked for of a hand with rotation R_WF.
template <class M> void refine_by_ik(double* x, std::size_t m, int iterations) {
  using R = typename M::Robot;
  constexpr int d = 3 + R::nq;
  IkOptions options;
  options.iterations = iterations;
  for (std::size_t i = 0; i < m; i += kLanes) {
    Pack at[d], q[R::nq], residual;
    for (int l = 0; l < kLanes; ++l)
      for (int k = 0; k < d; ++k) at[k].l[l] = x[std::min(i + l, m - 1) * d + k];
    RbdData<R, Pack> data;
    rbd_kinematics(at + 3, data);
    Mat3<Pack> R_WF;
    Vec3<Pack> p_WF;
    rbd_frame_placement(data, M::frame, R_WF, p_WF);
    ik_reach<R>(M::frame, M::pose(R_WF), Vec3<Pack>(at[0], at[1], at[2]), at + 3, options, data, q, residual);
    for (std::size_t l = 0; l < std::size_t(kLanes) && i + l < m; ++l)
      for (int k = 0; k < R::nq; ++k) x[(i + l) * d + 3 + k] = q[k].l[l];
  }
}

}  // namespace engram::offline
#endif  // CODEGEN_OFFLINE_STUDY_IK_H_
