// A gait on flat ground: which feet stand and swing in each slot of time, where they land, and how they swing.
//
// Time is cut into slots (whole knots of the horizon). A gait G is data:
//
//   struct G { static constexpr int nfeet, nphases, lead; static constexpr GaitPhase phase[nphases];   round and round, begins with a swing
//              static constexpr double slot, swing_height;   length of a slot [s]; [m]
//              static void within_reach(int f, const Placement (&feet)[nfeet], Placement& at); };   foothold `at` of foot f, others standing
//
//   standing -> (asked to walk) lead: all feet, `lead` slots -> phase 0 -> 1 -> ... -> 0 ...
//   (asked to stop) -> every foot swings once more, to under the body -> standing
//
// The body's path (x, y, yaw) is the command, integrated. A foot lands where the body will be half a stance later, plus its own offset:
// in the middle of its stance it is where it is when the robot stands.
#ifndef CONTROLLER_LOOP_LOOP_GAIT_H_
#define CONTROLLER_LOOP_LOOP_GAIT_H_

#include <cmath>
#include <cstdint>

namespace engram {

// A foot, or a body, on the ground: position [m] and heading [rad] in the world.
struct Placement {
  double p[3] = {}, yaw = 0.0;
};

// This placement moved by (x, y) in its own axes.
inline Placement moved(const Placement& from, double x, double y) {
  Placement to = from;
  to.p[0] += std::cos(from.yaw) * x - std::sin(from.yaw) * y;
  to.p[1] += std::sin(from.yaw) * x + std::cos(from.yaw) * y;
  return to;
}

// The same angle, whole turns nearer to another.
inline double nearest_turn(double angle, double to) { return angle + 2.0 * M_PI * std::round((to - angle) / (2.0 * M_PI)); }

// Velocity of the body in its own axes [m/s, rad/s]; walk: feet swing.
struct Pace {
  double vx = 0.0, vy = 0.0, wz = 0.0;
  bool walk = false;
};

struct GaitPhase {
  unsigned swing;  // feet in the air, bit c for contact c
  int slots;       // length
};

// Where a swinging foot is at share s (0 to 1) of its swing: xy and yaw by a quintic at rest at both ends, z = 16 h s^2 (1 - s)^2 above
// the line between its ends.
inline Placement swing_placement(const Placement& from, const Placement& to, double height, double s) {
  const double r = s * s * s * (10.0 + s * (-15.0 + 6.0 * s));
  Placement at;
  for (int i = 0; i < 3; ++i) at.p[i] = from.p[i] + r * (to.p[i] - from.p[i]);
  at.p[2] += 16.0 * height * s * s * (1.0 - s) * (1.0 - s);
  at.yaw = from.yaw + r * (to.yaw - from.yaw);
  return at;
}

template <class G> class Gait {
 public:
  static constexpr int nfeet = G::nfeet;

  // A stretch of the window in which the same feet stand.
  struct Phase {
    int64_t first = 0;     // slot
    int slots = 0;         // length; kEver: no end
    unsigned swing = 0;    // feet in the air
    Placement from[nfeet]; // at its beginning; of a standing foot for all of it
    Placement to[nfeet];   // at its end
    double zmp[2][2];      // centre of pressure at its two ends, linear between them [m]

    bool covers(int64_t slot) const { return slot < first + slots; }
    double share(double slot) const { return (slot - static_cast<double>(first)) / slots; }
  };
  static constexpr int kEver = 1 << 28, kPhases = 24;

  // Stands on these feet from `slot` on, with the body between them.
  void begin(int64_t slot, const Placement (&feet)[nfeet], const Placement& body) {
    slot_ = first_ = slot;
    cursor_ = {kStanding, 0, false};
    body_ = body;
    for (int f = 0; f < nfeet; ++f) {
      foot_[f] = feet[f];
      foot_[f].yaw = nearest_turn(feet[f].yaw, body.yaw);
      const double dx = feet[f].p[0] - body.p[0], dy = feet[f].p[1] - body.p[1], c = std::cos(body.yaw), s = std::sin(body.yaw);
      offset_[f] = {c * dx + s * dy, -s * dx + c * dy, foot_[f].yaw - body.yaw};
    }
    support(0, foot_, zmp_);
    swung_ = {};
    n_ = 0;
  }

  // Follows time to `slot`: what the window planned has happened.
  void advance(int64_t slot, const Pace& pace) {
    for (; slot_ < slot; ++slot_) {
      if (walking()) step_body(pace, body_);
      if (n_ == 0 || phase_[0].covers(slot_ + 1)) continue;
      for (int f = 0; f < nfeet; ++f) foot_[f] = phase_[0].to[f];
      for (int i = 0; i < 2; ++i) zmp_[i] = phase_[0].zmp[1][i];
      if (phase_[0].swing != 0) swung_ = phase_[0];
      cursor_ = after(cursor_, pace.walk);
      if (!walking()) swung_ = {};
      first_ = slot_ + 1;
      plan(pace, 1);
    }
  }

  // The body's path moves by this [m], world axes: footholds have, and do not come back.
  void move_path(const double (&shift)[2]) {
    for (int i = 0; i < 2; ++i) body_.p[i] += shift[i];
  }
  // Slots from the one under way to the next touch-down.
  int to_landing() const {
    int i = 0;
    while (i + 1 < n_ && phase_[i].swing == 0) ++i;
    return static_cast<int>(phase_[i].first + phase_[i].slots - slot_);
  }

  // A standing foot is really here. Headings grow beyond pi as the robot turns; a measured one does not.
  void measured(int f, const Placement& at) {
    const double yaw = nearest_turn(at.yaw, foot_[f].yaw);
    foot_[f] = at;
    foot_[f].yaw = yaw;
  }

  // Plans `slots` slots from now on. push: how far every coming foothold moves [m], world x and y.
  void plan(const Pace& pace, int slots, const double (&push)[2] = {0.0, 0.0}) {
    if (cursor_.index == kStanding && pace.walk) {
      cursor_ = after(cursor_, true);
      first_ = slot_;
    }
    Cursor cursor = cursor_;
    Placement foot[nfeet];
    for (int f = 0; f < nfeet; ++f) foot[f] = foot_[f];
    int64_t first = first_;
    for (n_ = 0; n_ < kPhases && first < slot_ + slots; ++n_) {
      Phase& p = phase_[n_];
      p.first = first;
      p.slots = length(cursor);
      p.swing = cursor.index >= 0 ? G::phase[cursor.index].swing : 0u;
      for (int f = 0; f < nfeet; ++f) {
        p.from[f] = p.to[f] = foot[f];
        if (p.swing >> f & 1u) p.to[f] = foothold(f, first + p.slots, pace, push);
      }
      for (int f = 0; f < nfeet; ++f) {
        if ((p.swing >> f & 1u) == 0) continue;
        G::within_reach(f, p.from, p.to[f]);
        foot[f] = p.to[f];
      }
      first += p.slots;
      cursor = after(cursor, pace.walk);
    }
    join_pressures();
  }

  bool walking() const { return cursor_.index != kStanding; }
  bool leads() const { return cursor_.index == kLead; }  // about to walk
  int64_t slot() const { return slot_; }
  const Placement& body() const { return body_; }
  // Slots since the phase under way began.
  int64_t age() const { return slot_ - first_; }
  bool stands(int f) const { return cursor_.index < 0 || (G::phase[cursor_.index].swing >> f & 1u) == 0; }

  // The phase of a slot of the window.
  const Phase& at(int64_t slot) const {
    int i = 0;
    while (i + 1 < n_ && !phase_[i].covers(slot)) ++i;
    return phase_[i];
  }
  // Phases of the window, and the last swing before it; none since the robot stood: no slots.
  int phases() const { return n_; }
  const Phase& phase(int i) const { return phase_[i]; }
  const Phase& swung() const { return swung_; }
  // The body at a later slot.
  Placement body_at(int64_t slot, const Pace& pace) const {
    Placement b = body_;
    for (int64_t s = slot_; walking() && s < slot; ++s) step_body(pace, b);
    return b;
  }

 private:
  static constexpr int kStanding = -1, kLead = -2;
  // Where in the gait: index of the phase, swings left before it may stop, and whether the phase began when it was to stop.
  struct Cursor {
    int index, left;
    bool closing;
  };

  static int length(const Cursor& c) { return c.index == kStanding ? kEver : c.index == kLead ? G::lead : G::phase[c.index].slots; }
  static constexpr int swings() {
    int n = 0;
    for (const GaitPhase& p : G::phase) n += p.swing != 0;
    return n;
  }
  static constexpr int cycle() {
    int n = 0;
    for (const GaitPhase& p : G::phase) n += p.slots;
    return n;
  }
  static Cursor after(const Cursor& c, bool walk) {
    if (c.index == kStanding) return walk ? Cursor{kLead, swings(), false} : c;
    if (c.index == kLead) return {0, swings(), !walk};
    const bool swung = G::phase[c.index].swing != 0;
    const int left = walk ? swings() : c.left - (swung && c.closing);
    if (left <= 0 && !swung) return {kStanding, 0, false};
    return {(c.index + 1) % G::nphases, left, !walk};
  }

  static void step_body(const Pace& pace, Placement& b) {
    b = moved(b, pace.vx * G::slot, pace.vy * G::slot);
    b.yaw += pace.wz * G::slot;
  }

  Placement foothold(int f, int64_t landing, const Pace& pace, const double (&push)[2]) const {
    int swing = 0;
    for (const GaitPhase& p : G::phase) swing += p.swing >> f & 1u ? p.slots : 0;
    const Placement body = body_at(landing + (cycle() - swing) / 2, pace);
    Placement at = moved(body, offset_[f].x, offset_[f].y);
    at.yaw += offset_[f].yaw;
    at.p[2] = foot_[f].p[2];
    for (int i = 0; i < 2; ++i) at.p[i] += push[i];
    return at;
  }

  // Centre of the feet that stand.
  static void support(unsigned swing, const Placement (&feet)[nfeet], double (&zmp)[2]) {
    int n = 0;
    zmp[0] = zmp[1] = 0.0;
    for (int f = 0; f < nfeet; ++f) {
      if (swing >> f & 1u) continue;
      ++n;
      for (int i = 0; i < 2; ++i) zmp[i] += feet[f].p[i];
    }
    for (int i = 0; i < 2; ++i) zmp[i] /= n;
  }

  // Under the standing feet while others swing, linear in between; at the window's ends, where it was and between all feet.
  void join_pressures() {
    for (int k = 0; k < n_; ++k) {
      Phase& p = phase_[k];
      if (p.swing != 0 || p.slots == kEver) support(p.swing, p.from, p.zmp[0]);
      for (int i = 0; i < 2; ++i) p.zmp[1][i] = p.zmp[0][i];
    }
    for (int k = 0; k < n_; ++k) {
      Phase& p = phase_[k];
      if (p.swing != 0 || p.slots == kEver) continue;
      double all[2];
      support(0, p.from, all);
      for (int i = 0; i < 2; ++i) {
        p.zmp[0][i] = k > 0 ? phase_[k - 1].zmp[1][i] : zmp_[i];
        p.zmp[1][i] = k + 1 < n_ ? phase_[k + 1].zmp[0][i] : all[i];
      }
    }
  }

  struct Offset {
    double x = 0.0, y = 0.0, yaw = 0.0;
  };
  int64_t slot_ = 0, first_ = 0;  // now; where the phase under way began
  Cursor cursor_ = {kStanding, 0, false};
  Placement foot_[nfeet], body_;  // as the phase under way began; now
  Offset offset_[nfeet];          // of a foot from the body when it stands [m, rad]
  double zmp_[2] = {};            // as the phase under way began
  int n_ = 0;
  Phase phase_[kPhases], swung_;
};

}  // namespace engram
#endif  // CONTROLLER_LOOP_LOOP_GAIT_H_
