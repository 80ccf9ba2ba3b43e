// The lower rungs of the ladder, by the kind of robot. A Hold has
//
//   static constexpr double kOverspeed                       of the velocity limit: beyond it damping takes over
//   void begin(double rate, const double* x)                 from now on keep the posture of x; rate: bandwidth [rad/s]
//   void hold(const double* x, const double* v, double* u)   torque that keeps it in the state x, of which v is to be damped
//   void damp(const double* x, const double* v, double* u)   torque that takes out the motion
//
// Both laws are written to u (nu) without limits: the fast side clamps them.
#ifndef CONTROLLER_LOOP_LOOP_HOLD_H_
#define CONTROLLER_LOOP_LOOP_HOLD_H_

#include "controller/loop/loop_plan.h"
#include "controller/ocp/ocp_stance.h"
#include "controller/rbd/rbd_crba.h"
#include "controller/rbd/rbd_manifold.h"
#include "controller/rbd/rbd_rnea.h"

#include <algorithm>

namespace engram {

inline constexpr double kDamping = 0.1;  // s/rad, of the torque limit

// An arm: u drives the last nu dofs, and moves them all.
//   hold   u = ID(q, v, a),  a = -w^2 (q (-) q_h) - 2 w v
//   damp   u = g(q) - D v,   D = kDamping of the torque limit per rad/s
template <class P> class DrivenHold {
 public:
  using R = typename P::R;
  static constexpr int nv = P::nv, nu = P::nu, first = nv - nu;
  static constexpr double kOverspeed = 1.5;

  void begin(double rate, const double* x) {
    rate_ = rate;
    std::memcpy(q_, x, sizeof(q_));
  }
  void hold(const double* x, const double* v, double* u) const {
    RbdData<R, double> d;
    double a[nv], force[nv];
    const double w = rate_;
    rbd_difference<R>(x, q_, a);
    for (int i = 0; i < nv; ++i) a[i] = w * w * a[i] - 2.0 * w * v[i];
    rbd_rnea<R>(x, v, a, d, force);
    std::memcpy(u, force + first, sizeof(double) * nu);
  }
  void damp(const double* x, const double* v, double* u) const {
    gravity_torque<P>(x, u);
    for (int i = 0; i < nu; ++i) u[i] -= kDamping * R::u_max[i] * v[first + i];
  }

 private:
  double rate_ = 0.0, q_[P::nq] = {};
};

// A robot that stands on all its contacts: stiff joints about the posture, and the torques that carry its weight.
//   hold   u = u_h - Kp (q (-) q_h) - Kd v,   Kp = kStiffness of the torque limit per rad,  Kd = 2 Kp / (10 w)
//   damp   u = u_q - Kd v,                    u_h, u_q: ocp_stance.h, at the posture held and the posture now
// Kd is bounded by what the smallest inertia behind a joint bears at a command every millisecond.
template <class P> class StanceHold {
 public:
  using R = typename P::R;
  static constexpr int nv = P::nv, nu = P::nu, first = nv - nu, joint = P::nq - nu;
  static constexpr double kOverspeed = 5.0;  // a push lets head and hands race, and a robot that is only damped falls

  void begin(double rate, const double* x) {
    std::memcpy(q_, x, sizeof(q_));
    stance_torques<P>(q_, kAllContacts, u_);
    gains(rate, x);
  }
  void hold(const double* x, const double* v, double* u) const {
    for (int i = 0; i < nu; ++i) u[i] = u_[i] - Kp_[i] * (x[joint + i] - q_[joint + i]) - Kd_[i] * v[first + i];
  }
  void damp(const double* x, const double* v, double* u) {
    if (Kd_[0] == 0.0) gains(kDampRate, x);
    stance_torques<P>(x, kAllContacts, u);
    for (int i = 0; i < nu; ++i) u[i] -= Kd_[i] * v[first + i];
  }

 private:
  static constexpr unsigned kAllContacts = (1u << P::Contacts::n) - 1u;
  static constexpr double kStiffness = 10.0;  // 1/rad, of the torque limit
  static constexpr double kDampRate = 10.0;   // rad/s
  static constexpr double kStep = 1e-3;       // s, between commands
  static constexpr double kShare = 0.3;       // of the inertia behind a joint, per command

  void gains(double rate, const double* q) {
    RbdData<R, double> d;
    BranchMatrix<R, double> M;
    rbd_kinematics<R>(q, d);
    rbd_inertias<R>(d);
    rbd_composite_inertias<R>(d);
    rbd_crba_lower<R>(d, M);
    for (int i = 0; i < nu; ++i) {
      Kp_[i] = kStiffness * R::u_max[i];
      Kd_[i] = std::min(Kp_[i] / (2.0 * rate), kShare * M.diagonal[first + i] / kStep);
    }
  }

  double q_[P::nq] = {}, u_[nu] = {}, Kp_[nu] = {}, Kd_[nu] = {};
};

}  // namespace engram
#endif  // CONTROLLER_LOOP_LOOP_HOLD_H_
