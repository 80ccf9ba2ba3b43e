// Gaits, footholds, the inverted pendulum, and what they write into the knots of a robot on legs.
#include <gtest/gtest.h>

#include <cmath>
#include <memory>

#include "controller/loop/loop_anymal.h"
#include "controller/loop/loop_capture.h"
#include "controller/loop/loop_talos.h"
#include "controller/loop/loop_walk_memory.h"
#include "tables/talos_step/task.h"

namespace engram {
namespace {

using G = AnymalTrot::Gait;
constexpr double kX = 0.3, kY = 0.2;  // m, feet from the body

Placement at(double x, double y, double yaw = 0.0) {
  Placement p;
  p.p[0] = x;
  p.p[1] = y;
  p.yaw = yaw;
  return p;
}
void stand(Gait<G>& gait, double yaw = 0.0) {
  const Placement body = at(1.0, 2.0, yaw);
  Placement feet[4];
  for (int f = 0; f < 4; ++f) feet[f] = moved(body, f < 2 ? kX : -kX, f % 2 == 0 ? kY : -kY);
  gait.begin(0, feet, body);
}

TEST(Swing, BeginsAndEndsAtRestOnTheGround) {
  const Placement from = at(0.0, 0.0), to = at(0.2, -0.1, 0.3);
  const Placement begin = swing_placement(from, to, 0.06, 0.0), top = swing_placement(from, to, 0.06, 0.5), end = swing_placement(from, to, 0.06, 1.0);
  EXPECT_EQ(begin.p[0], 0.0);
  EXPECT_NEAR(end.p[0], 0.2, 1e-15);
  EXPECT_NEAR(end.yaw, 0.3, 1e-15);
  EXPECT_NEAR(top.p[2], 0.06, 1e-15);
  EXPECT_NEAR(top.p[0], 0.1, 1e-15);
  const double h = 1e-4;  // rise 16 h_swing s^2: 1e-8 after a step of h
  EXPECT_LT(std::fabs(swing_placement(from, to, 0.06, h).p[2]), 1e-7);
  EXPECT_LT(std::fabs(swing_placement(from, to, 0.06, 1.0 - h).p[2]), 1e-7);
}

// The memory is asked for a whole walk from lead to rest: the knots of every step follow each other, its feet are those of the step before,
// and what lies ahead when a slot enters the horizon is what was there when it is walked.
TEST(WalkStep, KnotsAndFeetFollowEachOther) {
  using Task = tasks::TalosStep;
  Gait<TalosWalk::Gait> gait;
  const Placement body = at(0.3, -0.2, 1.0), feet[2] = {moved(body, 0.0, 0.085), moved(body, 0.0, -0.085)};
  gait.begin(0, feet, body);
  constexpr int kAhead = 20, kSlots = 200;
  StepTask step, last;
  int knot, before = -1, steps = 0, knots = 0;
  for (int64_t slot = 0; slot < kSlots; ++slot) {
    const Pace pace = {0.3, 0.05, 0.2, slot < 100};
    gait.advance(slot, pace);
    gait.plan(pace, 60);
    if (!walk_step<Task>(gait, slot + kAhead, 0.0, step, knot)) continue;
    ++knots;
    if (before < 0 || knot != before + 1) {
      EXPECT_EQ(knot, before < 0 ? kAhead : step_first<Task>(step)) << "slot " << slot;
      if (before >= 0) {
        EXPECT_EQ(before, step_last<Task>(last) - 1) << "slot " << slot;
        EXPECT_EQ(step.foot, 1 - last.foot);
        EXPECT_TRUE(step.from_walk && last.into_walk);
        for (int i = 0; i < 3; ++i) {
          EXPECT_NEAR(step.feet[last.foot][i], last.goal[i], 1e-12);
          EXPECT_NEAR(step.previous[i], last.feet[last.foot][i], 1e-12);
          EXPECT_NEAR(step.goal[i], last.next[i], 1e-12);
        }
      }
      ++steps;
    }
    before = knot;
    last = step;
  }
  EXPECT_GT(steps, 5);
  EXPECT_FALSE(last.into_walk);  // it came to rest
  EXPECT_EQ(before, Task::nknots - 1);
}

// Whatever is commanded and however hard the push, no foot of Talos lands on the other one, across it, or out of reach.
TEST(GaitTest, StepsStayOffEachOtherAndWithinReach) {
  using W = TalosWalk::Gait;
  using Task = TalosWalk::Task;
  for (double vx : {Task::task_lo[0], Task::task_hi[0]})
    for (double vy : {Task::task_lo[1], 0.0, Task::task_hi[1]})
      for (double wz : {Task::task_lo[2], Task::task_hi[2]})
        for (double push : {-1.0, 0.0, 1.0}) {
          Gait<W> gait;
          const Placement body = at(0.3, -0.2, 1.0), feet[2] = {moved(body, 0.0, 0.085), moved(body, 0.0, -0.085)};
          gait.begin(0, feet, body);
          const Pace pace = {vx, vy, wz, true};
          const double shift[2] = {push, -push};
          for (int64_t slot = 0; slot < 120; ++slot) {
            gait.advance(slot, pace);
            gait.plan(pace, 40, shift);
            for (int64_t later = slot; later < slot + 40; ++later) {
              const auto& p = gait.at(later);
              if (p.swing == 0) continue;
              const int f = p.swing == 1u ? 0 : 1;
              const Placement& stands = p.from[1 - f];
              const double dx = p.to[f].p[0] - stands.p[0], dy = p.to[f].p[1] - stands.p[1], c = std::cos(stands.yaw), s = std::sin(stands.yaw);
              EXPECT_LE(std::fabs(c * dx + s * dy), Task::gait_ahead + 1e-12);
              EXPECT_GE((f == 0 ? 1.0 : -1.0) * (-s * dx + c * dy), Task::gait_aside[0] - 1e-12);
              EXPECT_LE((f == 0 ? 1.0 : -1.0) * (-s * dx + c * dy), Task::gait_aside[1] + 1e-12);
            }
          }
        }
}

struct Law {
  static constexpr double gain = 1.0, hold[2] = {0.03, 0.02}, reach = 0.3, rate = 1.0;
};

TEST(Capture, MovesFootholdsByWhatTheSolesCannotHold) {
  CaptureStep<Law> step;
  const double grows = 3.0, none[2] = {0.0, 0.0}, little[2] = {0.029, -0.019}, much[2] = {0.05, 0.0};
  step.update(little, 0.0, grows, 1.0);
  EXPECT_EQ(step.shift()[0], 0.0);
  EXPECT_EQ(step.shift()[1], 0.0);
  step.update(much, 0.0, grows, 1.0);
  EXPECT_NEAR(step.shift()[0], 3.0 * (0.05 - 0.03), 1e-15);
  const double left[2] = {0.05 - step.shift()[0] / grows, 0.0};  // the reference has gone along with the foothold
  step.update(left, 0.0, grows, 1.0);
  EXPECT_NEAR(step.shift()[0], 0.06, 1e-15);
  step.clear();
  step.update(much, 0.5 * M_PI, grows, 1.0);  // sideways now: the soles hold less
  EXPECT_NEAR(step.shift()[0], 3.0 * (0.05 - 0.02), 1e-15);
  const double huge[2] = {0.0, -1.0};
  step.clear();
  step.update(huge, 0.0, grows, 0.1);
  EXPECT_NEAR(step.shift()[1], -0.1, 1e-15);  // no faster than a foot follows
  for (int i = 0; i < 9; ++i) step.update(huge, 0.0, grows, 0.1);
  EXPECT_NEAR(step.shift()[1], -0.3, 1e-15);  // no farther than it reaches
  step.clear();
  step.update(none, 0.0, grows, 1.0);
  EXPECT_EQ(step.shift()[1], 0.0);
}

TEST(GaitTest, StandsUntilAskedToWalkAndAgainAfterwards) {
  Gait<G> gait;
  stand(gait);
  gait.plan(Pace{}, 30);
  EXPECT_FALSE(gait.walking());
  EXPECT_EQ(gait.at(1000).swing, 0u);
  const Pace walk = {0.5, 0.0, 0.0, true};
  for (int slot = 0; slot < 100; ++slot) {
    gait.advance(slot, walk);
    gait.plan(walk, 60);
    const auto& now = gait.at(slot);
    const bool lead = slot < G::lead;
    EXPECT_EQ(now.swing == 0u, lead || (slot - G::lead) % (G::swing + G::stance) >= G::swing) << slot;
  }
  int stood = 100;
  for (int slot = 100; slot < 200; ++slot) {
    gait.advance(slot, Pace{});
    gait.plan(Pace{}, 60);
    if (gait.walking()) stood = slot + 1;
  }
  EXPECT_LT(stood, 100 + 3 * (G::swing + G::stance));  // at most the swing under way, and each pair once
  for (int f = 0; f < 4; ++f) {                        // every foot under the body, as it stood
    const Placement foot = gait.at(199).from[f], wanted = moved(gait.body(), f < 2 ? kX : -kX, f % 2 == 0 ? kY : -kY);
    for (int i = 0; i < 2; ++i) EXPECT_NEAR(foot.p[i], wanted.p[i], 1e-12);
  }
}

TEST(GaitTest, AFootIsUnderTheBodyInTheMiddleOfItsStance) {
  const Pace walk = {0.4, -0.1, 0.3, true};
  Gait<G> gait;
  stand(gait, 2.0);
  for (int slot = 0; slot < 80; ++slot) {
    gait.advance(slot, walk);
    gait.plan(walk, 40);
  }
  int checked = 0;
  for (int slot = 80; slot < 110; ++slot) {
    const auto& phase = gait.at(slot);
    for (int f = 0; f < 4; ++f) {
      if ((phase.swing >> f & 1u) == 0 || slot + 1 != phase.first + phase.slots) continue;
      const int half = (2 * (G::swing + G::stance) - G::swing) / 2;
      const Placement wanted = moved(gait.body_at(slot + 1 + half, walk), f < 2 ? kX : -kX, f % 2 == 0 ? kY : -kY);
      for (int i = 0; i < 2; ++i) EXPECT_NEAR(phase.to[f].p[i], wanted.p[i], 1e-12);
      ++checked;
    }
  }
  EXPECT_GE(checked, 2);
}

// A robot that turns on and on: headings that are measured jump by a turn at pi, footholds must not.
TEST(GaitTest, TurnsBeyondHalfATurn) {
  const Pace turn = {0.0, 0.0, 0.5, true};
  Gait<G> gait;
  stand(gait, 3.0);
  for (int slot = 0; slot < 200; ++slot) {
    gait.advance(slot, turn);
    for (int f = 0; f < 4 && gait.walking() && gait.age() == 1; ++f) {
      if (!gait.stands(f)) continue;
      Placement seen = gait.at(slot).from[f];
      seen.yaw = std::atan2(std::sin(seen.yaw), std::cos(seen.yaw));
      gait.measured(f, seen);
    }
    gait.plan(turn, 40);
    for (int f = 0; f < 4; ++f) EXPECT_LT(std::fabs(gait.at(slot).to[f].yaw - gait.at(slot).from[f].yaw), 0.5) << slot;
  }
  EXPECT_GT(gait.body().yaw, 3.5);
}

TEST(Lipm, SolvesItsEquationAndIsBounded) {
  constexpr int n = 60;
  constexpr double dt = 0.02, z = 0.5;
  double zmp[n], c[n];
  for (int i = 0; i < n; ++i) zmp[i] = i < 20 ? 0.0 : i < 40 ? 0.1 : -0.1;
  lipm_reference(dt, z, 0.02, zmp, c);
  EXPECT_EQ(c[0], 0.02);
  EXPECT_EQ(c[n - 1], zmp[n - 1]);
  for (int i = 1; i < n - 1; ++i) {
    EXPECT_NEAR(c[i] - z / 9.81 * (c[i - 1] - 2.0 * c[i] + c[i + 1]) / (dt * dt), zmp[i], 1e-12);
    EXPECT_LT(std::fabs(c[i]), 0.1);
  }
}

// A swing reference that is left in the terminal knot, or in a foot that stands already, pulls the foot off the ground after its
// touch-down; the robot then walks in short steps or not at all, while the same problem looks well when it is solved alone.
TEST(LeggedKnots, FeetWeighWhileTheySwingAndAsTheyLandOnly) {
  using M = LeggedModel<AnymalTrot>;
  using W = AnymalTrot::Task;
  const auto model = std::make_unique<M>();
  const auto h = std::make_unique<Horizon<M::P, M::N>>();
  double x[M::P::nx] = {};
  std::memcpy(x, M::R::q_home, sizeof(M::R::q_home));
  model->begin(0, x);
  LeggedCommand walk;
  walk.pace = {0.3, 0.0, 0.0, true};
  model->take(0, walk);
  int swinging = 0, landing = 0;
  for (int64_t t = 0; t < 1500000; t += M::kTickUs) {
    int64_t utime[M::N + 1];
    knot_times<M::N>(t, 0, M::kStepUs, utime);
    h->n = M::N;
    model->pose(utime, x, *h);
    for (int k = 0; k <= M::N; ++k) {
      const int64_t slot = t / M::kStepUs + k;
      const double dt = h->knot[k].dt;
      for_contact<M::Contacts>([&](auto c) {
        const auto& p = static_cast<typename AnymalTrot::Swing<c>::template Param<double>&>(h->knot[k]);
        const bool stands = contact_active(h->phase[k], c), stood = k == 0 || contact_active(h->phase[k - 1], c);
        const bool inside = k < M::N, lands = inside && stands && !stood;
        if (k > 0 || !stands) {
          const double weight = !inside ? 0.0 : !stands ? W::gait_swing_weight : lands ? W::gait_swing_weight * W::gait_landing : 0.0;
          EXPECT_EQ(p.translation_w, dt * weight);
        }
        swinging += inside && !stands;
        landing += lands;
        if (lands) {
          EXPECT_NEAR(p.translation_p[2], 0.0, 0.03);  // m: on the ground
        }
        const auto& cone = static_cast<typename AnymalTrot::Cone<c>::template Param<double>&>(h->knot[k]);
        EXPECT_EQ(cone.friction_w > 0.0, stands && inside);
      });
      EXPECT_EQ(h->phase[k < M::N ? k : 0], 15u & ~model->gait().at(k < M::N ? slot : t / M::kStepUs).swing);
    }
  }
  EXPECT_GT(swinging, 1000);
  EXPECT_GT(landing, 100);
}

}  // namespace
}  // namespace engram
