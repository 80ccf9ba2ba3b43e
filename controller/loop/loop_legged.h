// A robot on legs, as the receding planner sees it: what the task asks for, written into the knots at every tick.
//
// A configuration C ties robot, terms and data together (loop_talos.h, loop_anymal.h):
//
//   struct C { using Task;   tables/<robot>_<task>/task.h: horizon, task vector, weights
//              using P;      the problem;  template <int c> using Swing, Cone: its terms of contact c
//              using Gait;   loop_gait.h
//              static constexpr int legs;  driven dofs of the legs, which come first
//              static constexpr int64_t kTickUs;  static constexpr int kIterations;  per tick
//              static constexpr double kAcceleration;  at which a commanded pace is taken up [m/s^2, rad/s^2]
//              struct Capture;   law of foot placement (loop_capture.h), and `frozen`: from so long before it lands a foothold stays [s]
//              static void command(const double* task, LeggedCommand&);
//              static void cone(Param&, double weight, double yaw), swing(Param&, double weight, const Placement&); };
//
// References: the posture of robot.toml, turned by the heading; the centre of mass of an inverted pendulum over the gait's centres of
// pressure (loop_lipm.h), at a height that the task may change; swinging feet on their curves (loop_gait.h). What they weigh:
// loop_legged_knot.h.
#ifndef CONTROLLER_LOOP_LOOP_LEGGED_H_
#define CONTROLLER_LOOP_LOOP_LEGGED_H_

#include "controller/loop/loop_capture.h"
#include "controller/loop/loop_gait.h"
#include "controller/loop/loop_hold.h"
#include "controller/loop/loop_legged_knot.h"
#include "controller/loop/loop_lipm.h"
#include "controller/loop/loop_receding.h"
#include "controller/ocp/ocp_com.h"
#include "controller/ocp/ocp_contact.h"
#include "controller/ocp/ocp_frame.h"
#include "controller/ocp/ocp_limits.h"
#include "controller/ocp/ocp_regularization.h"
#include "controller/ocp/ocp_torque.h"

namespace engram {

// What a task may ask for.
struct LeggedCommand {
  Pace pace;
  double height = 0.0;             // of the centre of mass above its height at home [m]
  double depth = 0.0, rate = 0.0;  // squats: down by depth and back [m], rate times per second [Hz]
  double hand[3] = {};             // where a hand shall be [m], world axes; of a configuration that reaches
};

// A configuration that reaches with a hand has `static constexpr bool kReaches = true` and, beyond the above,
//   static bool reachable(const LeggedCommand&)                          may a hand be there?
//   static void reach(Knot&, double weight, const LeggedCommand&, bool terminal)   terms of hand and obstacles of a knot that weighs so [s]
//   static void hand(const double* x, double (&p)[3])                    where it is [m]
template <class C, class = void> inline constexpr bool kReaches = false;
template <class C> inline constexpr bool kReaches<C, std::void_t<decltype(C::kReaches)>> = C::kReaches;

// The memory of a configuration: C::Memory, or none.
template <class C, class = void> struct MemoryOfLegs {
  using Type = NoMemory;
};
template <class C> struct MemoryOfLegs<C, std::void_t<typename C::Memory>> {
  using Type = typename C::Memory;
};

template <class C> class LeggedModel {
 public:
  using P = typename C::P;
  using R = typename P::R;
  using Contacts = typename P::Contacts;
  using Task = typename C::Task;
  using Memory = typename MemoryOfLegs<C>::Type;
  using Hold = StanceHold<P>;
  using Target = LeggedCommand;
  using Knot = typename P::template Knot<double>;
  static constexpr int N = Task::nknots, ntask = Task::ntask, nfeet = Contacts::n, kIterations = C::kIterations;
  static constexpr int64_t kStepUs = static_cast<int64_t>(1e6 * Task::dt + 0.5), kTickUs = C::kTickUs;
  // A push opens gaps that take some periods to close, and lets light joints race; the plan of before the push would be worse than any.
  static constexpr double kLargestNearGap = 1e3, kLargestGap = 1e3, kLargestSpeed = StanceHold<P>::kOverspeed;
  static_assert(kStepUs % kTickUs == 0, "a knot is a whole number of ticks");

  static bool target(const double* value, Target& t) {
    C::command(value, t);
    if constexpr (kReaches<C>) {
      if (!C::reachable(t)) return false;
    }
    return known(value);
  }
  static bool known(const double* value) {
    for (int i = 0; i < ntask; ++i)
      if (!(value[i] >= Task::task_lo[i] && value[i] <= Task::task_hi[i])) return false;
    return true;
  }
  static void path(const double* x, double (&p)[3]) {
    if constexpr (kReaches<C>) C::hand(x, p);
    else std::memcpy(p, x, sizeof p);
  }

  void begin(int64_t utime, const double* x);
  void take(int64_t utime, const Target& t);
  void pose(const int64_t (&utime)[N + 1], const double* x0, Horizon<P, N>& h);
  void extend(const Horizon<P, N>& h, int k, const double* x, double* u, double* x_next) const;

  void tell(engram_legs& legs) const;

  // Of a configuration whose memory continues plans (loop_continue.h).
  template <class Extend> bool go_on(int kept, Memory& memory, Seed<P, N>& seed, Extend extend) const {
    return memory.go_on(gait_, ground_, kept, seed, extend);
  }

  const Gait<typename C::Gait>& gait() const { return gait_; }

 private:
  static constexpr double kStep = 1e-6 * kStepUs, kBlend = 1.0;  // s
  static constexpr int kWindow = N + 1 + static_cast<int>(1.2 / kStep);  // slots: the pendulum looks 1.2 s beyond the horizon

  double height(int64_t utime) const;
  double heading(int64_t utime) const;
  static double at_height(const LeggedCommand& c, int64_t since_us);
  double blend(int64_t utime) const;
  void look(const double* x);
  void follow();
  void replan(double part);
  void pendulum();
  // Feet that stand in a slot: the phase of its knot.
  unsigned gait_contacts(int64_t slot) const { return ((1u << nfeet) - 1u) & ~gait_.at(slot).swing; }
  void torques(const double* x0, const Horizon<P, N>& h);
  const double* torque_of(unsigned active) const;
  void knot(int64_t utime, int64_t slot, double dt, bool terminal, Knot& k) const;
  template <int c> void foot(int64_t slot, double dt, bool terminal, double when, Knot& k) const;

  Gait<typename C::Gait> gait_;
  LeggedCommand now_, before_;   // the task, and the one it replaces
  Pace pace_;                    // followed now: on its way to the task's
  int64_t origin_ = 0, taken_ = 0, before_taken_ = 0;  // us: slot 0; when they came
  double z_ = 0.0;               // height of the centre of mass at home above the feet [m]
  double com_[2] = {};           // reference at the slot under way [m]
  double com_now_[3] = {};       // reference at the first knot [m]
  CaptureStep<typename C::Capture> capture_;    // by which footholds move
  double reference_[2][kWindow]; // centre of mass from there on [m]
  double ground_ = 0.0;          // height of the feet [m]
  double q_[R::nq];              // measured or expected
  // where the robot is now
  Placement feet_[nfeet];
  double seen_com_[3], seen_velocity_[3];
  // torques that carry the weight on each set of feet that occurs
  static constexpr int kSets = 4;
  int nsets_ = 0;
  unsigned set_[kSets];
  double stance_[kSets][R::nu];
};

// Feet, centre of mass and its velocity in the state x.
template <class C> void LeggedModel<C>::look(const double* x) {
  RbdData<R, double> d;
  rbd_kinematics<R>(x, d);
  rbd_velocity<R>(x + R::nq, d);
  rbd_subtree_moments<R>(d);
  const Vec3<double> com = rbd_com<R>(d);
  for (int f = 0; f < nfeet; ++f) {
    Mat3<double> R_WF;
    Vec3<double> p;
    rbd_frame_placement<R>(d, Contacts::frame[f], R_WF, p);
    for (int i = 0; i < 3; ++i) feet_[f].p[i] = p[i];
    feet_[f].yaw = Contacts::kind[f] == ContactKind::kSurface ? std::atan2(R_WF(1, 0), R_WF(0, 0)) : 0.0;
  }
  for (int i = 0; i < 3; ++i) {
    seen_com_[i] = com[i];
    seen_velocity_[i] = 0.0;
  }
  for (int k = 0; k < R::nv; ++k) {
    const Vec3<double> column = rbd_com_column<R>(d, k);
    for (int i = 0; i < 3; ++i) seen_velocity_[i] += column[i] * x[R::nq + k];
  }
}

// Where the robot stands is where it stays: feet as they are, the body above their centre, turned as the base is.
template <class C> void LeggedModel<C>::begin(int64_t utime, const double* x) {
  double home[R::nq + R::nv] = {};
  std::memcpy(home, R::q_home, sizeof(R::q_home));
  look(home);
  z_ = seen_com_[2];
  for (int f = 0; f < nfeet; ++f) z_ -= feet_[f].p[2] / nfeet;

  look(x);
  Placement body;
  ground_ = 0.0;
  for (int f = 0; f < nfeet; ++f) {
    for (int i = 0; i < 2; ++i) body.p[i] += feet_[f].p[i] / nfeet;
    ground_ += feet_[f].p[2] / nfeet;
  }
  const Mat3<double> R_WB = rotation_of(x + 3);
  body.yaw = std::atan2(R_WB(1, 0), R_WB(0, 0));
  gait_.begin(0, feet_, body);
  for (int i = 0; i < 2; ++i) com_[i] = body.p[i];
  capture_.clear();
  origin_ = taken_ = before_taken_ = utime;
  now_ = before_ = LeggedCommand{};
  pace_ = Pace{};
}

template <class C> void LeggedModel<C>::take(int64_t utime, const Target& t) {
  before_ = now_;
  before_taken_ = taken_;
  now_ = t;
  taken_ = utime;
}

// Share of the new task in the reference: 0 to 1 within kBlend, a quintic.
template <class C> double LeggedModel<C>::blend(int64_t utime) const {
  const double s = std::fmin(1.0, 1e-6 * static_cast<double>(utime - taken_) / kBlend);
  return s * s * s * (10.0 + s * (-15.0 + 6.0 * s));
}
template <class C> double LeggedModel<C>::at_height(const LeggedCommand& c, int64_t since_us) {
  return c.height - 0.5 * c.depth * (1.0 - std::cos(2.0 * M_PI * c.rate * 1e-6 * static_cast<double>(since_us)));
}
template <class C> double LeggedModel<C>::height(int64_t utime) const {
  const double s = blend(utime);
  return z_ + ground_ + (1.0 - s) * at_height(before_, utime - before_taken_) + s * at_height(now_, utime - taken_);
}
template <class C> double LeggedModel<C>::heading(int64_t utime) const {
  return gait_.body_at((utime - origin_) / kStepUs, pace_).yaw;
}

// The pace goes to the task's at the acceleration that the robot bears: footholds of feet in the air would jump with it. It begins with
// the first swing: a step that made up for the time before would turn the hips to their limits.
template <class C> void LeggedModel<C>::follow() {
  constexpr double step = C::kAcceleration * 1e-6 * kTickUs;
  const auto towards = [](double from, double to) { return std::clamp(to, from - step, from + step); };
  const Pace wanted = gait_.leads() ? Pace{} : now_.pace;
  pace_ = {towards(pace_.vx, wanted.vx), towards(pace_.vy, wanted.vy), towards(pace_.wz, wanted.wz), now_.pace.walk};
}

// The centre of mass over the window, from where the reference is.
template <class C> void LeggedModel<C>::pendulum() {
  for (int axis = 0; axis < 2; ++axis) {
    double zmp[kWindow];
    for (int i = 0; i < kWindow; ++i) {
      const int64_t slot = gait_.slot() + i;
      const auto& p = gait_.at(slot);
      const double s = p.share(static_cast<double>(slot));
      zmp[i] = p.zmp[0][axis] + s * (p.zmp[1][axis] - p.zmp[0][axis]);
    }
    lipm_reference(kStep, z_, com_[axis], zmp, reference_[axis]);
  }
}

// Footholds, phases and centre of mass of the window. part: share of the slot under way that is over.
template <class C> void LeggedModel<C>::replan(double part) {
  const double w = std::sqrt(9.81 / z_), left = kStep * (gait_.to_landing() - part);
  if (gait_.walking() && left > C::Capture::frozen) {
    double error[2];
    for (int i = 0; i < 2; ++i) {
      const double c0 = reference_[i][0], v = (reference_[i][1] - c0) / kStep;
      error[i] = seen_com_[i] - (c0 + part * kStep * v) + (seen_velocity_[i] - v) / w;
    }
    capture_.update(error, gait_.body().yaw, std::exp(w * left), 1e-6 * kTickUs);
  }
  gait_.plan(pace_, kWindow, capture_.shift());
  pendulum();
}

// The torques that carry the weight, for every set of feet that stands within the horizon.
template <class C> void LeggedModel<C>::torques(const double* x0, const Horizon<P, N>& h) {
  nsets_ = 0;
  for (int k = 0; k < N && nsets_ < kSets; ++k) {
    bool known = false;
    for (int i = 0; i < nsets_; ++i) known = known || set_[i] == h.phase[k];
    if (known) continue;
    set_[nsets_] = h.phase[k];
    stance_torques<P>(x0, h.phase[k], stance_[nsets_++]);
  }
}
template <class C> const double* LeggedModel<C>::torque_of(unsigned active) const {
  int i = 0;
  while (i + 1 < nsets_ && set_[i] != active) ++i;
  return stance_[i];
}

// Terms of one foot. when: time of the knot in slots.
template <class C> template <int c> void LeggedModel<C>::foot(int64_t slot, double dt, bool terminal, double when, Knot& k) const {
  const auto& phase = gait_.at(slot);
  const bool swings = (phase.swing >> c & 1u) != 0;
  const bool lands = !swings && slot > 0 && slot == phase.first && (gait_.at(slot - 1).swing >> c & 1u) != 0;
  const Placement at = swings ? swing_placement(phase.from[c], phase.to[c], C::Gait::swing_height, phase.share(when)) : phase.from[c];
  legged_foot<C, c>(at, swings, lands, Task::weights_cone, dt, terminal, k);
}

template <class C> void LeggedModel<C>::knot(int64_t utime, int64_t slot, double dt, bool terminal, Knot& k) const {
  const int at = static_cast<int>(slot - gait_.slot());
  const double when = static_cast<double>(utime - origin_) / static_cast<double>(kStepUs), part = when - static_cast<double>(slot);
  LeggedReference ref = {q_, heading(utime), gait_.walking() ? pace_.wz : 0.0, {}, {}, torque_of(gait_contacts(slot))};
  for (int i = 0; i < 2; ++i) {
    const double c0 = reference_[i][at], c1 = reference_[i][at + 1];
    ref.com[i] = c0 + part * (c1 - c0);
    ref.velocity[i] = (c1 - c0) / kStep;
  }
  ref.com[2] = height(utime);
  ref.velocity[2] = (height(utime + kTickUs) - height(utime)) / (1e-6 * kTickUs);
  legged_knot<C>(ref, dt, terminal, k);
  if constexpr (kReaches<C>) C::reach(k, terminal ? Task::weights_terminal : dt, now_, terminal);
  for_contact<Contacts>([&](auto c) { foot<c>(slot, dt, terminal, when, k); });
}

template <class C> void LeggedModel<C>::pose(const int64_t (&utime)[N + 1], const double* x0, Horizon<P, N>& h) {
  std::memcpy(q_, x0, sizeof(q_));
  look(x0);
  const int64_t slot = (utime[0] - origin_) / kStepUs;
  while (gait_.slot() < slot) {
    for (int i = 0; i < 2; ++i) com_[i] = reference_[i][1];
    const bool swings = gait_.at(gait_.slot()).swing != 0;
    gait_.advance(gait_.slot() + 1, pace_);
    if (swings && gait_.age() == 0) {  // landed
      gait_.move_path(capture_.shift());
      capture_.clear();
    }
    if (gait_.slot() < slot) replan(0.0);
  }
  if (gait_.walking())
    for (int f = 0; f < nfeet; ++f)
      if (gait_.stands(f) && gait_.age() == 1) gait_.measured(f, feet_[f]);
  const double part = static_cast<double>((utime[0] - origin_) % kStepUs) / kStepUs;
  if (!gait_.walking() || kStep * (gait_.to_landing() - part) > C::Capture::frozen) follow();
  replan(part);
  for (int k = 0; k < N; ++k) h.phase[k] = gait_contacts(slot + k);
  torques(x0, h);
  for (int k = 0; k <= N; ++k) {
    const double dt = k < N ? 1e-6 * static_cast<double>(utime[k + 1] - utime[k]) : kStep;
    knot(utime[k], slot + k, dt, k == N, h.knot[k]);
  }
  std::memcpy(com_now_, h.knot[0].com_ref, sizeof(com_now_));
}

template <class C> void LeggedModel<C>::tell(engram_legs& legs) const {
  static_assert(nfeet <= ENGRAM_FEET_MAX, "bounds of engram.h");
  const auto& phase = gait_.at(gait_.slot());
  legs.nfeet = nfeet;
  legs.swing = static_cast<int32_t>(phase.swing);
  for (int f = 0; f < nfeet; ++f) {
    std::memcpy(legs.foot[f], phase.to[f].p, sizeof(phase.to[f].p));
    legs.foot[f][3] = phase.to[f].yaw;
  }
  std::memcpy(legs.com, com_now_, sizeof(com_now_));
}

template <class C>
void LeggedModel<C>::extend(const Horizon<P, N>& h, int k, const double* x, double* u, double* x_next) const {
  std::memcpy(x_next, x, sizeof(double) * R::nq);
  std::memset(x_next + R::nq, 0, sizeof(double) * R::nv);
  std::memcpy(u, torque_of(h.phase[k]), sizeof(double) * R::nu);
}

}  // namespace engram
#endif  // CONTROLLER_LOOP_LOOP_LEGGED_H_
