// A craft that flies on thrusters to way points, as the receding planner sees it, and the lower rungs of its ladder.
#ifndef CONTROLLER_LOOP_LOOP_FLIGHT_H_
#define CONTROLLER_LOOP_LOOP_FLIGHT_H_

#include "controller/loop/loop_way.h"
#include "controller/ocp/ocp.h"
#include "controller/ocp/ocp_frame.h"
#include "controller/ocp/ocp_regularization.h"
#include "controller/ocp/ocp_torque.h"
#include "controller/rbd/rbd_com.h"

#include <algorithm>
#include <cmath>

namespace engram {

// Where to be [m], and the heading there [rad].
struct WayPoint {
  double p[3] = {}, yaw = 0.0;
};

// The attitude law of Lee, Leok, McClamroch (CDC 2010) in small: the wanted acceleration gives thrust and direction of the body's z.
//   f = m (a - g),  thrust = f . z_B,  w' = c^2 (z x R' f/|f| + z e_yaw) - 2 c w,  torque = I w' + w x I w
//   hold: a = -r^2 (p - p_h) - 2 r v,  damp: a = -2 r v;   c = the hold rate, r = c / 5
// Thrusters that push along z with mutually orthogonal rows of the actuation (a symmetric multicopter).
template <class P> class HoverHold {
 public:
  using R = typename P::R;
  static constexpr int nu = P::nu;
  static constexpr double kOverspeed = 1.5;

  void begin(double rate, const double* x) {
    rate_ = rate;
    std::copy(x, x + 3, p_);
    yaw_ = heading(base_rotation(x));
  }
  void hold(const double* x, const double* v, double* u) const { steer(rate_, 1.0, x, v, u); }
  void damp(const double* x, const double* v, double* u) const { steer(kDampRate, 0.0, x, v, u); }

 private:
  static constexpr double kDampRate = 10.0;       // rad/s
  static constexpr double kSlower = 0.2;          // position loop against attitude loop
  static constexpr double kLargest = 4.0;         // m/s^2, of a
  static constexpr int kRow[4] = {2, 3, 4, 5};    // of the base wrench: thrust and torques

  static constexpr double row_product(int a, int b) {
    double sum = 0.0;
    for (int i = 0; i < nu; ++i) sum += R::actuation[a][i] * R::actuation[b][i];
    return sum;
  }
  static constexpr bool rows_are_orthogonal() {
    for (int a : kRow)
      for (int b : kRow)
        if (a != b && !(row_product(a, b) < 1e-12 && row_product(a, b) > -1e-12)) return false;
    return true;
  }
  static_assert(R::nv == 6 && rows_are_orthogonal(), "a symmetric multicopter");

  static Mat3<double> base_rotation(const double* x) { return rotation_of(x + 3); }
  static double heading(const Mat3<double>& R_WB) { return std::atan2(R_WB(1, 0), R_WB(0, 0)); }

  void steer(double c, double stay, const double* x, const double* v, double* u) const {
    const double r = kSlower * c;
    const Mat3<double> R_WB = base_rotation(x);
    const Vec3<double> v_W = mul(R_WB, Vec3<double>(v[0], v[1], v[2])), w(v[3], v[4], v[5]);
    Vec3<double> f;
    for (int i = 0; i < 3; ++i) {
      const double a = std::clamp(-r * (stay * r * (x[i] - p_[i]) + 2.0 * v_W[i]), -kLargest, kLargest);
      f[i] = R::mass[0] * (a - R::gravity[i]);
    }
    const Vec3<double> f_B = mul_transposed(R_WB, f);
    const double along = 1.0 / std::sqrt(dot(f, f)), turn = stay * std::sin(yaw_ - heading(R_WB));
    const double e[3] = {-f_B[1] * along, f_B[0] * along, turn};  // z x R' f/|f|, and yaw
    const double* I = R::inertia[0];
    const double full[3][3] = {{I[0], I[1], I[2]}, {I[1], I[3], I[4]}, {I[2], I[4], I[5]}};
    Vec3<double> torque(0.0, 0.0, 0.0), spin(0.0, 0.0, 0.0);
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) {
        torque[i] += full[i][j] * (c * c * e[j] - 2.0 * c * w[j]);
        spin[i] += full[i][j] * w[j];
      }
    torque = torque + cross(w, spin);
    const double wrench[4] = {f_B[2], torque[0], torque[1], torque[2]};
    for (int i = 0; i < nu; ++i) {
      u[i] = 0.0;
      for (int k = 0; k < 4; ++k) u[i] += R::actuation[kRow[k]][i] * wrench[k] / row_product(kRow[k], kRow[k]);
    }
  }

  double rate_ = 0.0, p_[3] = {}, yaw_ = 0.0;
};

// Every knot asks for the way point, upright, at rest; thrusts within their limits (box of the solver).
template <class R> using FlightProblem = Ocp<R, FramePoseTerm<R, R::kBase>, StateTerm<R>, TorqueTerm<R>>;
template <class Task> class FlightModel : public WayModel<FlightModel<Task>, Task, FlightProblem<typename Task::Robot>, WayPoint> {
 public:
  using Base = WayModel<FlightModel, Task, FlightProblem<typename Task::Robot>, WayPoint>;
  using typename Base::Knot, typename Base::P, typename Base::R;
  using Hold = HoverHold<P>;

  static bool target(const double* value, WayPoint& t) {
    for (int i = 0; i < 3; ++i) t.p[i] = value[i];
    t.yaw = value[3];
    return Base::known(value);
  }
  static void path(const double* x, double (&p)[3]) { std::copy(x, x + 3, p); }
  static constexpr double rest(int) { return kHover; }
  void aim(const double*, bool) {}
  void knot(double dt, bool end, int, Knot& k) const {
    k.dt = dt;
    k.pose_w_p = end ? Task::terminal_position : dt * Task::weights_position;
    k.pose_w_R = end ? Task::terminal_rotation : dt * Task::weights_rotation;
    const double c = std::cos(target_.yaw), s = std::sin(target_.yaw), R_WT[9] = {c, -s, 0, s, c, 0, 0, 0, 1};
    std::copy(target_.p, target_.p + 3, k.pose_p);
    std::copy(R_WT, R_WT + 9, k.pose_R);
    for (int i = 0; i < P::nx; ++i) k.state_ref[i] = i == 6 ? 1.0 : 0.0;
    for (int i = 0; i < 6; ++i) {
      k.state_w[i] = 0.0;
      k.state_w[6 + i] = i < 3 ? (end ? Task::terminal_velocity : dt * Task::weights_velocity)
                               : (end ? Task::terminal_spin : dt * Task::weights_spin);
    }
    for (int i = 0; i < P::nu; ++i) {
      k.torque_w[i] = dt * Task::weights_thrust;
      k.torque_ref[i] = kHover;
    }
  }

 private:
  using Base::target_;
  static constexpr double kHover = -total_mass<R>() * R::gravity[2] / R::nu;  // N, each thruster
};

}  // namespace engram
#endif  // CONTROLLER_LOOP_LOOP_FLIGHT_H_
