// Inverse kinematics of a pose by damped Gauss-Newton with an active set of joint limits, many starts side by side.
#ifndef CONTROLLER_IK_IK_POSE_H_
#define CONTROLLER_IK_IK_POSE_H_

#include "controller/rbd/rbd_frames.h"
#include "controller/rbd/rbd_manifold.h"

namespace engram {

inline constexpr int kIkIterations = 24;
inline constexpr double kIkDamping = 0.1;        // times r'r: far from the solution steps shorten, near it they are Gauss-Newton's
inline constexpr double kIkDampingFloor = 1e-9;  // keeps J J' invertible where the hand loses a direction
inline constexpr double kIkStep = 0.5;           // [rad] largest change of a joint in one step
inline constexpr double kIkMargin = 0.05;        // [rad] kept to the joint limits

// From the posture q (nq), in place, to one whose frame has the position target.p [m] and rotation target.R (row-major) in the world:
//
//   r = (p - p*, log(R R*')),   dq = -W J' (J W J' + lambda I)^-1 r,   lambda = mu r'r + mu_floor
//
// The step of least change: where it starts decides which of the many solutions is found. W is the identity but for joints at a limit
// that the descent would push through it: those are left out. Returns |r| (position in m and rotation in rad as one norm) at the q it
// leaves. kIkIterations + 1 kinematics and 6 x 6 solves; no branch on a value, lanes do not mix. Fixed base only.
// Source: thesis, eq. 2.1-2.4; Sugihara, Solvability-unconcerned inverse kinematics (2011), for the damping by the residual.
template <class R, int frame, class S, class Target> S ik_pose(const Target& target, S* q, RbdData<R, S>& d) {
  static_assert(R::nq == R::nv, "a free base needs steps on its manifold");
  constexpr int nv = R::nv;
  const Vec3<S> p_target = constant3<S>(target.p);
  const Mat3<S> R_target = constant33<S>(target.R);
  S norm2 = 0.0;
  for (int iteration = 0;; ++iteration) {
    rbd_kinematics(q, d);
    Mat3<S> R_WF;
    Vec3<S> p_WF;
    rbd_frame_placement(d, frame, R_WF, p_WF);
    const Vec3<S> r_p = p_WF - p_target, r_R = mul(R_WF, log3<S>(matmul_transposed(R_target, R_WF)));
    norm2 = dot(r_p, r_p) + dot(r_R, r_R);
    if (iteration == kIkIterations) break;
    Mat<S, 6, nv> J;
    rbd_frame_jacobian(d, frame, p_WF, J);

    // leave out joints at a limit that steepest descent -J'r would push through it
    for (int k = 0; k < nv; ++k) {
      const S descent = -(dot(Vec3<S>(J.col(k).template head<3>()), r_p) + dot(Vec3<S>(J.col(k).template tail<3>()), r_R));
      const S room = select(descent > S(0.0), S(R::q_hi[k] - kIkMargin) - q[k], q[k] - S(R::q_lo[k] + kIkMargin));
      const auto free = room > S(0.0);
      for (int i = 0; i < 6; ++i) J(i, k) = select(free, J(i, k), S(0.0));
    }

    // J J' + lambda I = L L', lower triangle in place
    S L[6][6], y[6];
    for (int i = 0; i < 6; ++i) {
      for (int j = 0; j <= i; ++j) {
        S sum = 0.0;
        for (int k = 0; k < nv; ++k) sum += J(i, k) * J(j, k);
        L[i][j] = sum;
      }
      L[i][i] += kIkDamping * norm2 + kIkDampingFloor;
      y[i] = i < 3 ? r_p[i] : r_R[i - 3];
    }
    for (int i = 0; i < 6; ++i) {
      for (int j = 0; j <= i; ++j) {
        S sum = L[i][j];
        for (int k = 0; k < j; ++k) sum -= L[i][k] * L[j][k];
        L[i][j] = j < i ? S(sum / L[j][j]) : sqrt(sum);
      }
      S sum = y[i];
      for (int k = 0; k < i; ++k) sum -= L[i][k] * y[k];
      y[i] = sum / L[i][i];
    }
    for (int i = 5; i >= 0; --i) {
      S sum = y[i];
      for (int k = i + 1; k < 6; ++k) sum -= L[k][i] * y[k];
      y[i] = sum / L[i][i];
    }

    S dq[nv], largest = kIkStep;
    for (int k = 0; k < nv; ++k) {
      S sum = 0.0;
      for (int i = 0; i < 6; ++i) sum += J(i, k) * y[i];
      dq[k] = sum;
      largest = max(largest, abs(sum));
    }
    const S shorten = kIkStep / largest;
    for (int k = 0; k < nv; ++k) {
      q[k] = min(max(q[k] - shorten * dq[k], S(R::q_lo[k] + kIkMargin)), S(R::q_hi[k] - kIkMargin));
    }
  }
  return sqrt(norm2);
}

}  // namespace engram
#endif  // CONTROLLER_IK_IK_POSE_H_
