// Inverse kinematics of a frame's pose by damped Gauss-Newton, with a posture in the null space; every lane has its own start.
#ifndef CONTROLLER_IK_IK_REACH_H_
#define CONTROLLER_IK_IK_REACH_H_

#include "controller/rbd/rbd_frames.h"
#include "controller/rbd/rbd_manifold.h"

#include <limits>

namespace engram {

struct IkOptions {
  int iterations = 24;              // kinematics and 6 x 6 solves, always all of them
  double damping = 0.1;             // mu: times r'r, so that steps are short far away and Gauss-Newton's near the solution
  double damping_floor = 1e-9;      // mu_bar: keeps J J' invertible where the frame loses a direction of motion
  double max_step = 0.5;            // largest change of a joint in one iteration [rad, m]
  double margin = 0.0;              // kept to the joint limits [rad, m]
  double tolerance = 1e-9;          // residual below which a step is not asked to lessen it: there the posture may go on
  const double* posture = nullptr;  // (nq) configuration to prefer among the solutions; none if null
  double posture_gain = 0.3;        // fraction of the way to it per iteration
};

// A x = b for symmetric positive definite A (lower triangle given): factor once, then solve in place.
template <class S, int n> struct Cholesky {
  S L[n][n], inverse[n];  // 1 / L_ii

  void factor() {
    for (int i = 0; i < n; ++i) {
      for (int j = 0; j < i; ++j) {
        for (int k = 0; k < j; ++k) L[i][j] = nmadd(L[i][k], L[j][k], L[i][j]);
        L[i][j] *= inverse[j];
      }
      for (int k = 0; k < i; ++k) L[i][i] = nmadd(L[i][k], L[i][k], L[i][i]);
      inverse[i] = 1.0 / sqrt(L[i][i]);
    }
  }
  void solve(S (&x)[n]) const {
    for (int i = 0; i < n; ++i) {
      for (int k = 0; k < i; ++k) x[i] = nmadd(L[i][k], x[k], x[i]);
      x[i] *= inverse[i];
    }
    for (int i = n - 1; i >= 0; --i) {
      for (int k = i + 1; k < n; ++k) x[i] = nmadd(L[k][i], x[k], x[i]);
      x[i] *= inverse[i];
    }
  }
};

// Gauss-Newton step dq (nv) of the residual r = (p - p*, log(R R*')) at q, with a pull to the posture in its null space, and the slope
// d (r'r / 2) / d alpha along q (+) alpha dq. d holds the kinematics of q, p_WF the frame's origin.
//   dq = z - W J' (J W J' + lambda 1)^-1 (r + J W z),   z = gain (posture (-) q),   lambda = mu r'r + mu_bar
// W leaves out the joints at a limit that steepest descent -J'r would push through it; z stops at the limits.
template <class R, class S> void ik_step(const RbdData<R, S>& d, int frame, const S* q, const Vec3<S>& p_WF, const S (&r)[6],
                                         const IkOptions& o, S* dq, S& slope) {
  constexpr int nv = R::nv, base_v = has_free_base<R>() ? 6 : 0, shift = R::nq - nv;
  constexpr const Tree<R>& tree = kTree<R>;
  const Vec3<S> r_p(r[0], r[1], r[2]), r_R(r[3], r[4], r[5]);

  // dq = z, within the limits
  for (int k = 0; k < nv; ++k) dq[k] = 0.0;
  if (o.posture != nullptr) {
    S posture[R::nq];
    for (int i = 0; i < R::nq; ++i) posture[i] = o.posture[i];
    rbd_difference<R>(q, posture, dq);
    for (int k = 0; k < nv; ++k) {
      const int i = k + shift;
      dq[k] = k < base_v ? S(0.0) : min(max(o.posture_gain * dq[k], R::q_lo[i] + o.margin - q[i]), R::q_hi[i] - o.margin - q[i]);
    }
  }

  // J W, J'r, and the normal equations (J W J' + lambda 1) y = r + J W z
  Motion<S> JW[nv];
  S gradient[nv], y[6], damping = S(o.damping_floor);
  Cholesky<S, 6> A;
  for (int i = 0; i < 6; ++i) {
    damping = madd(o.damping * r[i], r[i], damping);
    y[i] = r[i];
    for (int j = 0; j < i; ++j) A.L[i][j] = 0.0;
  }
  for (int i = 0; i < 6; ++i) A.L[i][i] = damping;
  for (int k = 0; k < nv; ++k) {
    JW[k] = Motion<S>::zero();
    gradient[k] = 0.0;
    const int last = tree.last[R::frame_joint[frame]];
    if (k < base_v || k > last || last >= tree.end[k]) continue;  // the frame does not move with dof k
    const Motion<S> J = {cross_add(d.J[k].ang, p_WF, d.J[k].lin), d.J[k].ang};
    gradient[k] = dot_add<S>(J.lin, r_p, dot<S>(J.ang, r_R));
    const int i = k + shift;
    const S room = select(gradient[k] < S(0.0), R::q_hi[i] - o.margin - q[i], q[i] - (R::q_lo[i] + o.margin));
    JW[k] = J * select(room > S(0.0), S(1.0), S(0.0));
    const S column[6] = {JW[k].lin[0], JW[k].lin[1], JW[k].lin[2], JW[k].ang[0], JW[k].ang[1], JW[k].ang[2]};
    for (int a = 0; a < 6; ++a) {
      y[a] = madd(column[a], dq[k], y[a]);
      for (int b = 0; b <= a; ++b) A.L[a][b] = madd(column[a], column[b], A.L[a][b]);
    }
  }
  A.factor();
  A.solve(y);

  const Force<S> f = {{y[0], y[1], y[2]}, {y[3], y[4], y[5]}};
  S largest = o.max_step;
  for (int k = 0; k < nv; ++k) {
    dq[k] -= dot(JW[k], f);
    largest = max(largest, abs(dq[k]));
  }
  const S shorten = o.max_step / largest;
  slope = 0.0;
  for (int k = 0; k < nv; ++k) {
    dq[k] *= shorten;
    slope = madd(gradient[k], dq[k], slope);
  }
}

// From q_start (nq) to a configuration whose frame has the pose (R_WT, p_WT [m]) in the world; in lanes, one search per lane.
//   minimize r'r / 2,   r = (p - p*, log(R R*'))   [m, rad]
// By the step of ik_step: the least change, unless a posture asks for more. Each lane keeps its own step length: 1 after a step that
// was taken, halved while Armijo's condition fails against a running average of the cost (a strictly decreasing cost crawls along the
// joint limits: 99.1 instead of 99.85 % found from 0.4 rad away). A free base stays where it is.
// q_out keeps the joint limits; residual = |r| there, infinite if the pose is not finite. d is scratch.
// A fixed number of operations, no branch on a value.
// Source: thesis, eq. 2.1-2.4; Sugihara, Solvability-Unconcerned Inverse Kinematics (2011), for the damping by the residual; Zhang &
// Hager, A Nonmonotone Line Search Technique (2004), for the average.
template <class R, class S> void ik_reach(int frame, const Mat3<S>& R_WT, const Vec3<S>& p_WT, const S* q_start,
                                          const IkOptions& o, RbdData<R, S>& d, S* q_out, S& residual) {
  constexpr int nv = R::nv, shift = R::nq - nv, base_v = has_free_base<R>() ? 6 : 0;
  constexpr double kArmijo = 1e-4, kMemory = 0.7, kInfinity = std::numeric_limits<double>::infinity();
  const auto keep_limits = [&](S* q) {
    for (int k = base_v; k < nv; ++k)
      q[k + shift] = min(max(q[k + shift], S(R::q_lo[k + shift] + o.margin)), S(R::q_hi[k + shift] - o.margin));
  };
  S q_try[R::nq], step[nv], slope = 0.0, alpha = 1.0, cost = kInfinity, average = kInfinity;
  for (int i = 0; i < R::nq; ++i) q_try[i] = q_start[i];
  for (int k = 0; k < nv; ++k) step[k] = 0.0;
  keep_limits(q_try);
  for (int i = 0; i < R::nq; ++i) q_out[i] = q_try[i];

  for (int iteration = 0;; ++iteration) {
    rbd_kinematics(q_try, d);
    Mat3<S> R_WF;
    Vec3<S> p_WF;
    rbd_frame_placement(d, frame, R_WF, p_WF);
    const Vec3<S> r_p = p_WF - p_WT, r_R = mul(R_WF, log3<S>(matmul_transposed(R_WT, R_WF)));
    const S r[6] = {r_p[0], r_p[1], r_p[2], r_R[0], r_R[1], r_R[2]};
    const S cost_try = 0.5 * dot_add(r_p, r_p, dot(r_R, r_R));

    const auto accept = cost_try <= max(madd(kArmijo * alpha, slope, average), S(0.5 * o.tolerance * o.tolerance));
    average = select(accept, iteration == 0 ? cost_try : madd(S(kMemory), average, (1 - kMemory) * cost_try), average);
    cost = select(accept, cost_try, cost);
    for (int i = 0; i < R::nq; ++i) q_out[i] = select(accept, q_try[i], q_out[i]);
    if (iteration == o.iterations) break;

    S step_try[nv], slope_try, dq[nv];
    ik_step(d, frame, q_try, p_WF, r, o, step_try, slope_try);
    alpha = select(accept, S(1.0), 0.5 * alpha);
    slope = select(accept, slope_try, slope);
    for (int k = 0; k < nv; ++k) {
      step[k] = select(accept, step_try[k], step[k]);
      dq[k] = alpha * step[k];
    }
    rbd_integrate<R>(q_out, dq, q_try);
    keep_limits(q_try);
  }
  residual = sqrt(2.0 * cost);
}

}  // namespace engram
#endif  // CONTROLLER_IK_IK_REACH_H_
