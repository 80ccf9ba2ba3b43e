// Steps on flat ground, from rest to rest: the optimal control problem of a single step, and of a walk of several, over the terms and
// weights of a walking task (loop_legged.h has them under way, in a horizon that recedes).
//
//   knots   | before |  swing  | between |    swing     | between | ... | after |     one step is kKnots long
//   feet    |  both  | stance  |  both   | the other one |  both   | ... |  both |
//   zmp     from between the feet to the one that stands, where it stays, and on to the next one; at last between the feet again
//
// A step of a walk ends, and the next begins, in the middle of `between`.
// References are those of the walk: posture of robot.toml turned by the heading, the centre of mass of an inverted pendulum over the
// centre of pressure (loop_lipm.h), the swinging foot on its curve, torques that carry the weight.
// The memory of steps knows the answers (docs/steps.md).
#ifndef CONTROLLER_LOOP_LOOP_STEPS_H_
#define CONTROLLER_LOOP_LOOP_STEPS_H_

#include "controller/ik/ik_feet.h"
#include "controller/loop/loop_legged_knot.h"
#include "controller/loop/loop_lipm.h"
#include "controller/loop/loop_talos.h"
#include "controller/ocp/ocp_stance.h"
#include "tables/talos_step/task.h"

namespace engram {

// Why steps cannot be planned.
enum class StepsFault {
  kNone,
  kOverlap,    // a sole stands on the other one
  kNoPosture,  // feet are too far apart for a posture, or not finite
};

// C: terms of a robot on two feet (TalosBody of loop_talos.h) under the numbers of its task.
template <class C, int most_> class Steps {
 public:
  using P = typename C::P;
  using R = typename P::R;
  using Contacts = typename P::Contacts;
  using Task = typename C::Task;
  using Knot = typename P::template Knot<double>;
  static constexpr int most = most_;  // steps
  static constexpr int kBefore = static_cast<int>(Task::gait_before), kSwing = static_cast<int>(Task::gait_swing);
  static constexpr int kAfter = static_cast<int>(Task::gait_after), kKnots = Task::nknots, N = most * kKnots;
  static constexpr int kBetween = static_cast<int>(Task::gait_between);
  static_assert(kBefore + kSwing + kAfter == kKnots, "phases of a step fill its horizon");
  static_assert(kBetween % 2 == 0 && kBetween <= kBefore + kAfter, "a step of a walk ends in the middle");
  static_assert(Contacts::n == 2, "one foot stands while the other swings");

  // Other than the task's, if wanted: weight of the wrench outside its cone, and knots on both feet between two swings (an even number, at
  // most kBefore + kAfter).
  explicit Steps(double cone = Task::weights_cone, int between = kBetween) : cone_(cone), between_(between) {
    double home[R::nq];
    std::memcpy(home, R::q_home, sizeof(home));
    RbdData<R, double> d;
    rbd_kinematics<R>(home, d);
    rbd_subtree_moments<R>(d);
    height_ = rbd_com<R>(d)[2];
    for (int f = 0; f < 2; ++f) height_ -= 0.5 * foot_of(d, f).p[2];
  }

  // From the feet at the start; foot[i] swings in step i, to goal[i]. count <= most.
  StepsFault plan(const Placement (&start)[2], int count, const int* foot, const Placement* goal) {
    count_ = count;
    for (int f = 0; f < 2; ++f) feet_[0][f] = start[f];
    for (int i = 0; i < count; ++i) {
      swing_[i] = foot[i];
      for (int f = 0; f < 2; ++f) feet_[i + 1][f] = feet_[i][f];
      feet_[i + 1][foot[i]] = goal[i];
    }
    for (int i = 0; i <= count; ++i) {
      body_[i] = between(feet_[i]);
      if (overlap(feet_[i][0], feet_[i][1])) return StepsFault::kOverlap;
      if (!stand(feet_[i], stance_[i])) return StepsFault::kNoPosture;
    }
    for (int i = 0; i < count; ++i)
      for (unsigned active = 1; active < 4; ++active) stance_torques<P>(stance_[i], active, torque_[i][active]);
    pendulum();
    return StepsFault::kNone;
  }

  int count() const { return count_; }
  int knots() const { return lifts(count_ - 1) + kSwing + kAfter; }
  // The knot at which step i begins.
  int begins(int i) const { return i == 0 ? 0 : lifts(i) - between_ / 2; }
  // At rest on the feet of the beginning (i = 0), or after step i: q (nq).
  const double* stance(int i) const { return stance_[i]; }
  double height() const { return height_; }

  // The problem from the state x0 (nq + nv).
  void pose(const double* x0, Horizon<P, N>& h) const {
    h.n = knots();
    std::memcpy(h.x0, x0, sizeof(h.x0));
    for (int k = 0; k < h.n; ++k) h.phase[k] = contacts(k);
    for (int k = 0; k <= h.n; ++k) knot(k, k == h.n, x0, h.knot[k]);
  }

  // Stage one of the data: a motion that follows the references by inverse kinematics and inverse dynamics, without optimization.
  // x (N + 1, nx), u (N, nu). Returns the largest error of feet and centre of mass [m, rad].
  double planned(const double* x0, double (*x)[P::nx], double (*u)[P::nu]) const {
    double worst = 0.0;
    std::memcpy(x[0], x0, sizeof(x[0]));
    for (int k = 1; k <= knots(); ++k) {
      std::memcpy(x[k], x[k - 1], sizeof(x[k]));
      const Heading turned = heading(k);
      double posture[R::nq];
      level(turned.yaw, posture);
      IkFoot feet[2];
      for (int f = 0; f < 2; ++f) feet[f] = ik_foot(placement(f, k));
      const double com[3] = {com_ref_[0][k], com_ref_[1][k], height_ + ground()};
      worst = std::fmax(worst, ik_feet<R>(Contacts::frame, feet, com, posture, IkFeetOptions{}, x[k]));
    }
    controls(x, u, true);
    return worst;
  }

  // Along the postures in x: velocities of the integrator, and the torques of the motion or (moving false) of rest in each posture.
  void controls(double (*x)[P::nx], double (*u)[P::nu], bool moving) const {
    double v[R::nv], a[R::nv];
    std::memcpy(v, x[0] + R::nq, sizeof(v));
    for (int k = 0; k < knots(); ++k) {
      double dq[R::nv];
      rbd_difference<R>(x[k], x[k + 1], dq);
      for (int i = 0; i < R::nv; ++i) {
        const double next = dq[i] / Task::dt;
        a[i] = (next - v[i]) / Task::dt;
        v[i] = x[k + 1][R::nq + i] = next;
      }
      if (moving) inverse_dynamics_on_contacts<P>(x[k], x[k] + R::nq, a, contacts(k), u[k]);
      else stance_torques<P>(x[k], contacts(k), u[k]);
    }
  }

  // Feet that stand in knot k.
  unsigned contacts(int k) const { return swings(k) ? 3u & ~(1u << swing_[step(k)]) : 3u; }
  // Where a foot is, or should be, at knot k.
  Placement placement(int f, int k) const {
    const int i = step(k), at = k - lifts(i);
    if (f != swing_[i] || at < 0) return feet_[i][f];
    if (at >= kSwing) return feet_[i + 1][f];
    return swing_placement(feet_[i][f], feet_[i + 1][f], Task::gait_height, at / static_cast<double>(kSwing));
  }

  static Placement between(const Placement (&feet)[2]) {
    Placement body;
    for (int i = 0; i < 3; ++i) body.p[i] = 0.5 * (feet[0].p[i] + feet[1].p[i]);
    body.yaw = 0.5 * (feet[0].yaw + feet[1].yaw);
    return body;
  }

 private:
  static constexpr int kRest = kBefore / 2;                        // knots
  static constexpr int kTail = static_cast<int>(1.2 / Task::dt);  // knots that the pendulum looks beyond the end

  struct Heading {
    double yaw, rate;
  };

  static Placement foot_of(const RbdData<R, double>& d, int f) {
    Mat3<double> R_WF;
    Vec3<double> p;
    rbd_frame_placement<R>(d, Contacts::frame[f], R_WF, p);
    return {{p[0], p[1], p[2]}, std::atan2(R_WF(1, 0), R_WF(0, 0))};
  }
  static IkFoot ik_foot(const Placement& at) { return {{at.p[0], at.p[1], at.p[2]}, at.yaw}; }
  // The knot at which the foot of step i leaves the ground; the step of a knot.
  int lifts(int i) const { return kBefore + i * (kSwing + between_); }
  int step(int k) const { return std::clamp((k - kBefore + between_ / 2) / (kSwing + between_), 0, count_ - 1); }
  bool swings(int k) const {
    const int at = k - lifts(step(k));
    return at >= 0 && at < kSwing;
  }
  double ground() const { return 0.5 * (feet_[0][0].p[2] + feet_[0][1].p[2]); }

  // The posture of robot.toml with its base at a heading.
  static void level(double yaw, double* q) {
    std::memcpy(q, R::q_home, sizeof(R::q_home));
    q[3] = q[4] = 0.0;
    q[5] = std::sin(0.5 * yaw);
    q[6] = std::cos(0.5 * yaw);
  }

  // Do the soles' rectangles meet? Not if an axis of one of them separates them.
  static bool overlap(const Placement& a, const Placement& b) {
    const double turn = b.yaw - a.yaw, c = std::fabs(std::cos(turn)), s = std::fabs(std::sin(turn));
    const double reach[2] = {Task::sole_half[0] * (1.0 + c) + Task::sole_half[1] * s, Task::sole_half[1] * (1.0 + c) + Task::sole_half[0] * s};
    for (const Placement* axes : {&a, &b}) {
      const double cx = std::cos(axes->yaw), sx = std::sin(axes->yaw), dx = b.p[0] - a.p[0], dy = b.p[1] - a.p[1];
      if (!(std::fabs(cx * dx + sx * dy) < reach[0]) || !(std::fabs(-sx * dx + cx * dy) < reach[1])) return false;
    }
    return true;
  }

  // At rest with the centre of mass above the middle of the feet.
  bool stand(const Placement (&feet)[2], double* q) const {
    const Placement body = between(feet);
    level(body.yaw, q);
    for (int i = 0; i < 2; ++i) q[i] = body.p[i];
    double posture[R::nq];
    std::memcpy(posture, q, sizeof(posture));
    const IkFoot wanted[2] = {ik_foot(feet[0]), ik_foot(feet[1])};
    const double com[3] = {body.p[0], body.p[1], height_ + body.p[2]};
    return ik_feet<R>(Contacts::frame, wanted, com, posture, IkFeetOptions{}, q) < 1e-4;
  }

  // The heading turns while a foot swings, by a quintic.
  Heading heading(int k) const {
    const int i = step(k);
    const double s = std::fmin(std::fmax((k - lifts(i)) / static_cast<double>(kSwing), 0.0), 1.0);
    const double turn = body_[i + 1].yaw - body_[i].yaw, rate = turn / (kSwing * Task::dt);
    return {body_[i].yaw + turn * s * s * s * (10.0 + s * (-15.0 + 6.0 * s)), rate * 30.0 * s * s * (1.0 - s) * (1.0 - s)};
  }

  // Centre of pressure at knot k. At the two ends of a walk it rests for kRest knots between the feet.
  void pressure(int k, double (&zmp)[2]) const {
    const int i = step(k), lifted = k - lifts(i), landed = lifted - kSwing;
    const Placement& foot = feet_[i][1 - swing_[i]];
    for (int axis = 0; axis < 2; ++axis) {
      const double here = foot.p[axis];
      double other = here, share = 0.0;  // of the other end, when both feet stand
      if (lifted < 0 && i == 0) {
        other = body_[0].p[axis];
        share = std::fmin(1.0, -lifted / static_cast<double>(kBefore - kRest));
      } else if (lifted < 0) {
        other = feet_[i - 1][1 - swing_[i - 1]].p[axis];
        share = -lifted / static_cast<double>(between_);
      } else if (landed > 0 && i + 1 == count_) {
        other = body_[count_].p[axis];
        share = std::fmin(1.0, landed / static_cast<double>(kAfter - kRest));
      } else if (landed > 0) {
        other = feet_[i + 1][1 - swing_[i + 1]].p[axis];
        share = landed / static_cast<double>(between_);
      }
      zmp[axis] = here + share * (other - here);
    }
  }

  void pendulum() {
    double zmp[2][N + kTail], c[N + kTail];
    for (int k = 0; k < knots() + kTail; ++k) {
      double at[2];
      pressure(k, at);
      for (int axis = 0; axis < 2; ++axis) zmp[axis][k] = at[axis];
    }
    for (int axis = 0; axis < 2; ++axis) {
      for (int k = knots() + kTail; k < N + kTail; ++k) zmp[axis][k] = body_[count_].p[axis];
      lipm_reference(Task::dt, height_, body_[0].p[axis], zmp[axis], c);
      std::memcpy(com_ref_[axis], c, sizeof(com_ref_[axis]));
    }
  }

  template <int f> void foot(int k, double dt, bool terminal, Knot& knot) const {
    const bool in_air = swings(k) && swing_[step(k)] == f;
    const bool lands = !in_air && k > 0 && swings(k - 1) && swing_[step(k - 1)] == f;
    legged_foot<C, f>(placement(f, k), in_air, lands, cone_, dt, terminal, knot);
  }

  void knot(int k, bool terminal, const double* x0, Knot& to) const {
    to = {};
    const Heading turned = heading(k);
    LeggedReference ref = {x0, turned.yaw, turned.rate, {}, {}, torque_[step(k)][contacts(k)]};
    for (int i = 0; i < 2; ++i) {
      ref.com[i] = com_ref_[i][k];
      ref.velocity[i] = (com_ref_[i][k + 1] - com_ref_[i][k]) / Task::dt;
    }
    ref.com[2] = height_ + ground();
    legged_knot<C>(ref, Task::dt, terminal, to);
    foot<0>(k, Task::dt, terminal, to);
    foot<1>(k, Task::dt, terminal, to);
  }

  double cone_;                         // weight of the wrench outside its cone [1/N^2]
  double height_;                       // of the centre of mass above the feet [m]
  int between_;                         // knots on both feet between two swings
  int count_ = 0, swing_[most];         // steps; the foot that swings in each
  Placement feet_[most + 1][2], body_[most + 1];
  double stance_[most + 1][R::nq];      // at rest before and after every step
  double torque_[most][4][R::nu];       // that carry the weight at the beginning of a step, by the feet that stand
  double com_ref_[2][N + kTail];        // [m]
};

using TalosSteps = Steps<TalosBody<tasks::TalosStep, 20>, 3>;

}  // namespace engram
#endif  // CONTROLLER_LOOP_LOOP_STEPS_H_
