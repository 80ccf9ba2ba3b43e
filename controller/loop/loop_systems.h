// The small analytic systems (ocp_systems.h) as the receding planner sees them, and the lower rungs of their ladders.
//
//   pendulum   swings up and stays: every knot asks for the goal, the nearest turn of it when the task comes
//   unicycle   parks: knots ask for the way that a guiding law takes, since no quadratic cost of the goal alone gets a robot that cannot
//              roll sideways there
//   bicopter   flies to way points: every knot asks for the goal
#ifndef CONTROLLER_LOOP_LOOP_SYSTEMS_H_
#define CONTROLLER_LOOP_LOOP_SYSTEMS_H_

#include "controller/loop/loop_gait.h"
#include "controller/loop/loop_way.h"
#include "controller/ocp/ocp_systems.h"

#include <algorithm>
#include <cmath>

namespace engram {

// The problem of a system with the limits that its robot.toml states; the loop knows speeds by them.
template <class System, class R_> struct SystemOcp : AnalyticOcp<System> {
  using R = R_;
  static constexpr bool limits_agree() {
    for (int i = 0; i < System::nu; ++i)
      if (R::u_max[i] != System::u_hi[i] || u_lo_of(i) != System::u_lo[i]) return false;
    return R::nq == System::n && R::nu == System::nu;
  }

 private:
  template <class T> static constexpr auto least(int i, int) -> decltype(T::u_lo[i]) { return T::u_lo[i]; }
  template <class T> static constexpr double least(int i, long) { return -T::u_max[i]; }
  static constexpr double u_lo_of(int i) { return least<R>(i, 0); }
};

inline double turn_about(double angle) { return nearest_turn(angle, 0.0); }  // to [-pi, pi]

// Weights of a knot, as the tables [weights] and [terminal] of task.toml have them.
template <class Task, class Knot> void weigh(double dt, bool end, int n, int nu, Knot& k) {
  for (int i = 0; i < n; ++i) k.w_x[i] = end ? Task::terminal_position[i] : dt * Task::weights_position[i];
  for (int i = 0; i < nu; ++i) k.w_u[i] = end ? 0.0 : dt * Task::weights_control[i];
  k.dt = dt;
}
template <class Task, class Knot> void weigh_velocity(double dt, bool end, int n, Knot& k) {
  for (int i = 0; i < n; ++i) k.w_x[n + i] = end ? Task::terminal_velocity[i] : dt * Task::weights_velocity[i];
}

struct Goal {
  double q[3] = {};
};

//   hold   u = m l^2 a + b q' - m g l sin q,  a = -w^2 (q - q_h) - 2 w q'      damp   u = -kDamping u_max q'
class PendulumHold {
 public:
  static constexpr double kOverspeed = 1.5;
  void begin(double rate, const double* x) { rate_ = rate, q_ = x[0]; }
  void hold(const double* x, const double* v, double* u) const {
    using S = Pendulum;
    const double a = -rate_ * rate_ * (x[0] - q_) - 2.0 * rate_ * v[0];
    u[0] = S::m * S::l * S::l * a + S::b * v[0] - S::m * S::g * S::l * std::sin(x[0]);
  }
  void damp(const double*, const double* v, double* u) const { u[0] = -kDamping * Pendulum::u_hi[0] * v[0]; }

 private:
  double rate_ = 0.0, q_ = 0.0;
};

template <class Task>
class PendulumModel : public WayModel<PendulumModel<Task>, Task, SystemOcp<Pendulum, typename Task::Robot>, Goal> {
 public:
  using Base = WayModel<PendulumModel, Task, SystemOcp<Pendulum, typename Task::Robot>, Goal>;
  using typename Base::Knot, typename Base::P;
  using Hold = PendulumHold;
  static_assert(P::limits_agree(), "robot.toml and ocp_systems.h state the same limits");

  static bool target(const double* value, Goal& t) { return t.q[0] = value[0], Base::known(value); }
  static void path(const double* x, double (&p)[3]) {  // the mass
    p[0] = Pendulum::l * std::sin(x[0]), p[1] = 0.0, p[2] = Pendulum::l * std::cos(x[0]);
  }
  static constexpr double rest(int) { return 0.0; }
  void aim(const double* x0, bool fresh) {
    if (fresh) angle_ = nearest_turn(this->target_.q[0], x0[0]);
  }
  void knot(double dt, bool end, int, Knot& k) const {
    weigh<Task>(dt, end, 1, 1, k);
    weigh_velocity<Task>(dt, end, 1, k);
    k.x_ref[0] = angle_;
    k.x_ref[1] = k.u_ref[0] = 0.0;
  }

 private:
  double angle_ = 0.0;
};

// Stands still: hold and damp are no speed.
class RollHold {
 public:
  static constexpr double kOverspeed = 1.5;
  void begin(double, const double*) {}
  void hold(const double*, const double*, double* u) const { u[0] = u[1] = 0.0; }
  void damp(const double*, const double*, double* u) const { u[0] = u[1] = 0.0; }
};

// The guiding law leads to the goal at distance rho, alpha off the heading, beta short of the goal's heading:
//
//   speed = k_rho rho,  turn = k_alpha alpha + k_beta beta      (both scaled alike to their limits; backwards if the goal lies behind)
//
// Source: Astolfi, Exponential Stabilization of a Wheeled Mobile Robot via Discontinuous Control, J. Dyn. Sys. (1999), equation 8.
template <class Task>
class UnicycleModel : public WayModel<UnicycleModel<Task>, Task, SystemOcp<Unicycle, typename Task::Robot>, Goal> {
 public:
  using Base = WayModel<UnicycleModel, Task, SystemOcp<Unicycle, typename Task::Robot>, Goal>;
  using typename Base::Knot, typename Base::P;
  using Hold = RollHold;
  static_assert(P::limits_agree(), "robot.toml and ocp_systems.h state the same limits");

  static bool target(const double* value, Goal& t) { return std::copy(value, value + 3, t.q), Base::known(value); }
  static void path(const double* x, double (&p)[3]) { p[0] = x[0], p[1] = x[1], p[2] = 0.0; }
  static constexpr double rest(int) { return 0.0; }
  void aim(const double* x0, bool fresh) {
    std::copy(x0, x0 + 3, way_);
    if (fresh) backwards_ = std::fabs(turn_about(bearing() - way_[2])) > 0.5 * M_PI;
  }
  // Knots come in their order: each one carries the guided robot on.
  void knot(double dt, bool end, int, Knot& k) {
    weigh<Task>(dt, end, 3, 2, k);
    for (int i = 0; i < 3; ++i) {
      k.x_ref[i] = way_[i];
      k.x_ref[3 + i] = k.w_x[3 + i] = 0.0;
    }
    guide(k.u_ref);
    way_[0] += dt * k.u_ref[0] * std::cos(way_[2]);
    way_[1] += dt * k.u_ref[0] * std::sin(way_[2]);
    way_[2] += dt * k.u_ref[1];
  }

 private:
  static constexpr double kThere = 1e-3;  // m, where the bearing means nothing any more

  double bearing() const { return std::atan2(this->target_.q[1] - way_[1], this->target_.q[0] - way_[0]); }
  void guide(double* u) const {
    const double rho = std::hypot(this->target_.q[0] - way_[0], this->target_.q[1] - way_[1]), about = backwards_ ? M_PI : 0.0;
    u[0] = 0.0;
    u[1] = Task::guide_alpha * turn_about(this->target_.q[2] - way_[2]);
    if (rho > kThere) {
      const double alpha = turn_about(bearing() - way_[2] - about), beta = turn_about(this->target_.q[2] + about - bearing());
      u[0] = (backwards_ ? -1.0 : 1.0) * Task::guide_rho * rho;
      u[1] = Task::guide_alpha * alpha + Task::guide_beta * beta;
    }
    const double over = std::max({1.0, std::fabs(u[0]) / Unicycle::u_hi[0], std::fabs(u[1]) / Unicycle::u_hi[1]});
    u[0] /= over, u[1] /= over;
  }

  double way_[3] = {};
  bool backwards_ = false;
};

// The planar HoverHold (loop_flight.h): the wanted acceleration gives thrust and pitch.
//   f = m (a + g z),  u0 + u1 = f . z_B,  l (u0 - u1) = I (c^2 (pitch of f - pitch) - 2 c pitch'),  a as there
class BicopterHold {
 public:
  static constexpr double kOverspeed = 1.5;
  void begin(double rate, const double* x) { rate_ = rate, p_[0] = x[0], p_[1] = x[1]; }
  void hold(const double* x, const double* v, double* u) const { steer(rate_, 1.0, x, v, u); }
  void damp(const double* x, const double* v, double* u) const { steer(kDampRate, 0.0, x, v, u); }

 private:
  static constexpr double kDampRate = 10.0, kSlower = 0.2, kLargest = 4.0;  // rad/s; 1; m/s^2

  void steer(double c, double stay, const double* x, const double* v, double* u) const {
    using S = Bicopter;
    const double r = kSlower * c;
    double a[2];
    for (int i = 0; i < 2; ++i) a[i] = std::clamp(-r * (stay * r * (x[i] - p_[i]) + 2.0 * v[i]), -kLargest, kLargest);
    const double f_x = S::m * a[0], f_z = S::m * (a[1] + S::g);
    const double lift = -f_x * std::sin(x[2]) + f_z * std::cos(x[2]);
    const double torque = S::I * (c * c * turn_about(std::atan2(-f_x, f_z) - x[2]) - 2.0 * c * v[2]);
    u[0] = 0.5 * (lift + torque / S::l);
    u[1] = 0.5 * (lift - torque / S::l);
  }

  double rate_ = 0.0, p_[2] = {};
};

template <class Task>
class BicopterModel : public WayModel<BicopterModel<Task>, Task, SystemOcp<Bicopter, typename Task::Robot>, Goal> {
 public:
  using Base = WayModel<BicopterModel, Task, SystemOcp<Bicopter, typename Task::Robot>, Goal>;
  using typename Base::Knot, typename Base::P;
  using Hold = BicopterHold;
  static_assert(P::limits_agree(), "robot.toml and ocp_systems.h state the same limits");

  static bool target(const double* value, Goal& t) { return std::copy(value, value + 2, t.q), Base::known(value); }
  static void path(const double* x, double (&p)[3]) { p[0] = x[0], p[1] = 0.0, p[2] = x[1]; }
  static constexpr double rest(int) { return Bicopter::hover; }
  void aim(const double*, bool) {}
  void knot(double dt, bool end, int, Knot& k) const {
    weigh<Task>(dt, end, 3, 2, k);
    weigh_velocity<Task>(dt, end, 3, k);
    std::copy(this->target_.q, this->target_.q + 3, k.x_ref);
    for (int i = 0; i < 3; ++i) k.x_ref[3 + i] = 0.0;
    for (double& u : k.u_ref) u = Bicopter::hover;
  }
};

}  // namespace engram
#endif  // CONTROLLER_LOOP_LOOP_SYSTEMS_H_
