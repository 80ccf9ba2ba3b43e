// ANYmal on its feet: the terms of its problem, and its tasks.
#ifndef CONTROLLER_LOOP_LOOP_ANYMAL_H_
#define CONTROLLER_LOOP_LOOP_ANYMAL_H_

#include "controller/loop/loop_legged.h"
#include "tables/anymal_trot/task.h"

namespace engram {

struct AnymalFeet {
  using Robot = robots::Anymal;
  static constexpr int n = 4;
  static constexpr int frame[n] = {Robot::kLfFoot, Robot::kRfFoot, Robot::kLhFoot, Robot::kRhFoot};
  static constexpr ContactKind kind[n] = {ContactKind::kPoint, ContactKind::kPoint, ContactKind::kPoint, ContactKind::kPoint};
  static constexpr double kp = 0.0, kd = 20.0;
};

template <class Task_> struct AnymalBody {
  using Task = Task_;
  using Robot = robots::Anymal;
  template <int c> using Swing = FrameTranslationTerm<Robot, AnymalFeet::frame[c]>;
  template <int c> using Cone = FrictionConeTerm<c>;
  using P = ContactOcp<AnymalFeet, StateTerm<Robot>, TorqueTerm<Robot>, LimitTerm<Robot>, ComTerm<Robot>, Swing<0>, Swing<1>, Swing<2>,
                       Swing<3>, Cone<0>, Cone<1>, Cone<2>, Cone<3>>;
  static constexpr int legs = 12;  // driven dofs
  static constexpr int64_t kTickUs = 10000;
  static constexpr int kIterations = 2;  // per tick; with one, every fourth push of 25 N s brought the trot down
  static constexpr double kAcceleration = 1.5;  // of the pace [m/s^2, rad/s^2]

  template <class Param> static void cone(Param& p, double weight, double) {
    p.friction_w = weight;
    p.friction_mu = Task::sole_friction;
  }
  template <class Param> static void swing(Param& p, double weight, const Placement& at) {
    p.translation_w = weight;
    for (int i = 0; i < 3; ++i) p.translation_p[i] = at.p[i];
  }
};

// Trots at a commanded velocity, or stands.
struct AnymalTrot : AnymalBody<tasks::AnymalTrot> {
  struct Capture {
    static constexpr double gain = Task::gait_capture, hold[2] = {0.01, 0.01}, reach = Task::gait_push_reach, rate = Task::gait_push_rate;
    static constexpr double frozen = 0.0;
  };
  struct Gait {
    static constexpr unsigned kLeftFore = 1u, kRightFore = 2u, kLeftHind = 4u, kRightHind = 8u;
    static constexpr int swing = static_cast<int>(Task::gait_swing), stance = static_cast<int>(Task::gait_stance);
    static constexpr int nfeet = 4, nphases = 4, lead = static_cast<int>(Task::gait_lead);
    static constexpr GaitPhase phase[nphases] = {
        {kLeftFore | kRightHind, swing}, {0u, stance}, {kRightFore | kLeftHind, swing}, {0u, stance}};
    static constexpr double slot = Task::dt, swing_height = Task::gait_height;
    static void within_reach(int, const Placement (&)[nfeet], Placement&) {}
  };
  static void command(const double* task, LeggedCommand& c) {
    if (task[3] > 0.5) c.pace = {task[0], task[1], task[2], true};
  }
};

}  // namespace engram
#endif  // CONTROLLER_LOOP_LOOP_ANYMAL_H_
