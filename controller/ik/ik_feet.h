// Whole-body inverse kinematics of a robot on its feet: placements of all feet and the centre of mass, the posture in what is left.
//
//   minimize  w_F sum_f |r_f|^2 + w_c |c - c*|^2 + sum_i w_i (q (-) q*)_i^2,    r_f = (p - p*, log(R R*'))  of foot f, world axes
//
// by damped Gauss-Newton. Feet and centre of mass are met to some 1e-6 of their units, since w_F, w_c >> w_i.
// Source: thesis, equations 2.1 to 2.4.
#ifndef CONTROLLER_IK_IK_FEET_H_
#define CONTROLLER_IK_IK_FEET_H_

#include "controller/rbd/rbd_com.h"
#include "controller/rbd/rbd_frames.h"
#include "controller/rbd/rbd_manifold.h"

#include <Eigen/Cholesky>

#include <cmath>

namespace engram {

// A sole that lies level: position [m] and heading [rad] in the world.
struct IkFoot {
  double p[3], yaw;
};

struct IkFeetOptions {
  int iterations = 15;
  double foot = 1e6, com = 1e4;        // w_F [1/m^2, 1/rad^2], w_c [1/m^2]
  double orientation = 1e2;            // w_i of the base's orientation [1/rad^2]; its position is free
  double legs = 1e-1, rest = 1e1;      // of the first `nlegs` driven joints and of the others [1/rad^2]
  int nlegs = 12;
  double max_step = 0.3;               // largest change of a coordinate in one iteration [m, rad]
};

// From q (nq), in place. feet: wanted, of the frames `frame`; com: wanted [m]; posture (nq): q*, its base level and turned as wanted.
// Returns the largest |r_f| and |c - c*| that is left [m, rad].
template <class R, int nfeet>
double ik_feet(const int (&frame)[nfeet], const IkFoot (&feet)[nfeet], const double (&com)[3], const double* posture,
               const IkFeetOptions& o, double* q) {
  constexpr int nv = R::nv, rows = 6 * nfeet + 3;
  Eigen::Matrix<double, rows, nv> J;
  Eigen::Matrix<double, rows, 1> r;
  RbdData<R, double> d;
  double left = 0.0;
  for (int iteration = 0;; ++iteration) {
    rbd_kinematics<R>(q, d);
    rbd_subtree_moments<R>(d);
    for (int f = 0; f < nfeet; ++f) {
      Mat3<double> R_WF;
      Vec3<double> p;
      rbd_frame_placement<R>(d, frame[f], R_WF, p);
      const double c = std::cos(feet[f].yaw), s = std::sin(feet[f].yaw);
      Mat3<double> wanted;
      wanted << c, -s, 0, s, c, 0, 0, 0, 1;
      const Vec3<double> r_R = mul(R_WF, log3<double>(matmul_transposed(wanted, R_WF)));
      Mat<double, 6, nv> J_f;
      rbd_frame_jacobian<R>(d, frame[f], p, J_f);
      J.template middleRows<6>(6 * f) = J_f;
      for (int i = 0; i < 3; ++i) {
        r[6 * f + i] = p[i] - feet[f].p[i];
        r[6 * f + 3 + i] = r_R[i];
      }
    }
    const Vec3<double> c = rbd_com<R>(d);
    for (int i = 0; i < 3; ++i) r[6 * nfeet + i] = c[i] - com[i];
    for (int k = 0; k < nv; ++k) {
      const Vec3<double> column = rbd_com_column<R>(d, k);
      for (int i = 0; i < 3; ++i) J(6 * nfeet + i, k) = column[i];
    }
    left = r.template lpNorm<Eigen::Infinity>();
    if (iteration == o.iterations) return left;

    double away[nv];
    rbd_difference<R>(posture, q, away);
    Eigen::Matrix<double, rows, 1> w;
    w.template head<6 * nfeet>().setConstant(o.foot);
    w.template tail<3>().setConstant(o.com);
    Eigen::Matrix<double, nv, nv> H = J.transpose() * w.asDiagonal() * J;
    Eigen::Matrix<double, nv, 1> step = J.transpose() * w.cwiseProduct(r);
    for (int i = 0; i < nv; ++i) {
      const double weight = i < 3 ? 0.0 : i < 6 ? o.orientation : i < 6 + o.nlegs ? o.legs : o.rest;
      H(i, i) += weight + 1e-6;
      step[i] += weight * away[i];
    }
    step = H.llt().solve(step);
    const double largest = step.template lpNorm<Eigen::Infinity>();
    if (!std::isfinite(largest)) return largest;
    double dq[nv], q_next[R::nq];
    for (int i = 0; i < nv; ++i) dq[i] = -step[i] * (largest > o.max_step ? o.max_step / largest : 1.0);
    rbd_integrate<R>(q, dq, q_next);
    for (int i = 0; i < R::nq; ++i) q[i] = q_next[i];
  }
}

}  // namespace engram
#endif  // CONTROLLER_IK_IK_FEET_H_
