// Talos on its soles: the terms of its problem, and its tasks.
#ifndef CONTROLLER_LOOP_LOOP_TALOS_H_
#define CONTROLLER_LOOP_LOOP_TALOS_H_

#include "controller/loop/loop_legged.h"
#include "tables/talos_stand/task.h"
#include "tables/talos_walk/task.h"

namespace engram {

// kd_: damping of the contacts [1/s].
template <int kd_> struct TalosSoles {
  using Robot = robots::Talos;
  static constexpr int n = 2;
  static constexpr int frame[n] = {Robot::kLeftSole, Robot::kRightSole};
  static constexpr ContactKind kind[n] = {ContactKind::kSurface, ContactKind::kSurface};
  static constexpr double kp = 0.0, kd = kd_;
};

template <class Task_, int kd> struct TalosBody {
  using Task = Task_;
  using Robot = robots::Talos;
  using Soles = TalosSoles<kd>;
  template <int c> using Swing = FramePlacementTerm<Robot, Soles::frame[c]>;
  template <int c> using Cone = WrenchConeTerm<c>;
  using P = ContactOcp<Soles, StateTerm<Robot>, TorqueTerm<Robot>, LimitTerm<Robot>, ComTerm<Robot>, Swing<0>, Swing<1>, Cone<0>, Cone<1>>;
  static constexpr int legs = 12;  // driven dofs
  static constexpr int64_t kTickUs = 10000;
  static constexpr int kIterations = 1;  // per tick
  static constexpr double kAcceleration = 1.0;  // of a pace, which only walking has
  struct Capture {
    static constexpr double gain = 0.0, hold[2] = {0.0, 0.0}, reach = 0.0, rate = 0.0, frozen = 0.0;
  };

  template <class Param> static void cone(Param& p, double weight, double yaw) {
    p.wrench_w = weight;
    p.wrench_mu = Task::sole_friction;
    for (int i = 0; i < 2; ++i) p.wrench_half[i] = Task::sole_half[i];
    p.wrench_x[0] = std::cos(yaw);
    p.wrench_x[1] = std::sin(yaw);
  }
  template <class Param> static void swing(Param& p, double weight, const Placement& at) {
    p.placement_w = weight;
    for (int i = 0; i < 3; ++i) p.placement_p[i] = at.p[i];
    const double c = std::cos(at.yaw), s = std::sin(at.yaw), R_WF[9] = {c, -s, 0, s, c, 0, 0, 0, 1};
    for (int i = 0; i < 9; ++i) p.placement_R[i] = R_WF[i];
  }
};

// Stands: height and squats of the centre of mass over feet that stay. Takes pushes without a step.
struct TalosStand : TalosBody<tasks::TalosStand, 50> {
  struct Gait {  // none
    static constexpr int nfeet = 2, nphases = 1, lead = 1;
    static constexpr GaitPhase phase[nphases] = {{0u, 1}};
    static constexpr double slot = Task::dt, swing_height = 0.0;
    static void within_reach(int, const Placement (&)[nfeet], Placement&) {}
  };
  static void command(const double* task, LeggedCommand& c) {
    c.height = task[0];
    c.depth = task[1];
    c.rate = task[2];
  }
};

// Walks at a commanded velocity, right foot first, or stands.
struct TalosWalk : TalosBody<tasks::TalosWalk, 20> {
  static constexpr double kAcceleration = Task::gait_acceleration;
  struct Capture {
    static constexpr double gain = Task::gait_capture, hold[2] = {Task::gait_hold[0], Task::gait_hold[1]};
    static constexpr double reach = Task::gait_push_reach, rate = Task::gait_push_rate, frozen = Task::gait_frozen;
  };
  struct Gait {
    static constexpr unsigned kLeft = 1u, kRight = 2u;
    static constexpr int swing = static_cast<int>(Task::gait_swing), stance = static_cast<int>(Task::gait_stance);
    static constexpr int nfeet = 2, nphases = 4, lead = static_cast<int>(Task::gait_lead);
    static constexpr GaitPhase phase[nphases] = {{kRight, swing}, {0u, stance}, {kLeft, swing}, {0u, stance}};
    static constexpr double slot = Task::dt, swing_height = Task::gait_height;
    // Soles neither on nor across each other, legs no further apart than they bear.
    static void within_reach(int f, const Placement (&feet)[nfeet], Placement& at) {
      const Placement& stands = feet[1 - f];
      const double c = std::cos(stands.yaw), s = std::sin(stands.yaw), dx = at.p[0] - stands.p[0], dy = at.p[1] - stands.p[1];
      const double side = f == 0 ? 1.0 : -1.0;
      const double x = std::clamp(c * dx + s * dy, -Task::gait_ahead, Task::gait_ahead);
      const double y = std::clamp(side * (-s * dx + c * dy), Task::gait_aside[0], Task::gait_aside[1]) * side;
      at.p[0] = stands.p[0] + c * x - s * y;
      at.p[1] = stands.p[1] + s * x + c * y;
    }
  };
  static void command(const double* task, LeggedCommand& c) {
    if (task[3] > 0.5) c.pace = {task[0], task[1], task[2], true};
  }
};

}  // namespace engram
#endif  // CONTROLLER_LOOP_LOOP_TALOS_H_
