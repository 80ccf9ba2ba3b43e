// Steps from rest to rest: what each knot asks for.
#include "controller/loop/loop_steps.h"

#include <gtest/gtest.h>

#include <memory>

namespace engram {
namespace {

struct Posed {
  TalosSteps steps;
  Horizon<TalosSteps::P, TalosSteps::N> h{};
};

// Two steps, left first, of feet that are turned.
std::unique_ptr<Posed> two_steps() {
  auto p = std::make_unique<Posed>();
  const Placement start[2] = {{{0.0, 0.09, 0.0}, 0.1}, {{0.02, -0.09, 0.0}, -0.1}};
  const Placement goal[2] = {{{0.2, 0.1, 0.0}, 0.2}, {{0.4, -0.08, 0.0}, 0.3}};
  const int foot[2] = {0, 1};
  EXPECT_EQ(p->steps.plan(start, 2, foot, goal), StepsFault::kNone);
  double x0[TalosSteps::P::nx] = {};
  std::memcpy(x0, p->steps.stance(0), sizeof(double) * TalosSteps::R::nq);
  p->steps.pose(x0, p->h);
  return p;
}

template <int foot, class Knot> double weight(const Knot& k) {
  return static_cast<const typename TalosBody<tasks::TalosStep, 20>::Swing<foot>::template Param<double>&>(k).placement_w;
}

constexpr int kPeriod = TalosSteps::kSwing + TalosSteps::kBetween;

// The step that a knot's foot swings in, if it were one of two, and knots since that foot left the ground.
struct When {
  int step, lifted;
  explicit When(int k)
      : step(k >= TalosSteps::kBefore + TalosSteps::kSwing + TalosSteps::kBetween / 2), lifted(k - TalosSteps::kBefore - step * kPeriod) {}
};

TEST(Steps, FeetStandSwingAndStand) {
  const auto p = two_steps();
  ASSERT_EQ(p->h.n, TalosSteps::kKnots + kPeriod);
  EXPECT_EQ(p->steps.begins(0), 0);
  EXPECT_EQ(p->steps.begins(1), TalosSteps::kBefore + TalosSteps::kSwing + TalosSteps::kBetween / 2);
  for (int k = 0; k < p->h.n; ++k) {
    const When when(k);
    const bool swings = when.lifted >= 0 && when.lifted < TalosSteps::kSwing;
    EXPECT_EQ(p->h.phase[k], swings ? (when.step == 0 ? 2u : 1u) : 3u) << k;
  }
}

// A swing reference at the end of the horizon would pull at a foot that stands by then.
TEST(Steps, AFootWeighsWhileItSwingsAndAsItLandsOnly) {
  const auto p = two_steps();
  const double swing = tasks::TalosStep::dt * tasks::TalosStep::gait_swing_weight;
  for (int k = 0; k <= p->h.n; ++k) {
    const When when(k);
    const double expected = k == p->h.n || when.lifted < 0 || when.lifted > TalosSteps::kSwing ? 0.0
                            : when.lifted < TalosSteps::kSwing                                 ? swing
                                                                                               : swing * tasks::TalosStep::gait_landing;
    EXPECT_EQ(weight<0>(p->h.knot[k]), when.step == 0 ? expected : 0.0) << k;
    EXPECT_EQ(weight<1>(p->h.knot[k]), when.step == 1 ? expected : 0.0) << k;
  }
}

TEST(Steps, TheCentreOfMassStartsAndEndsBetweenTheFeetAndMovesSmoothly) {
  const auto p = two_steps();
  EXPECT_NEAR(p->h.knot[0].com_ref[0], 0.01, 1e-12);
  EXPECT_NEAR(p->h.knot[0].com_ref[1], 0.0, 1e-12);
  EXPECT_NEAR(p->h.knot[p->h.n].com_ref[0], 0.3, 0.02);  // 0.1 m from there half a second before, and exp(-w t) since
  EXPECT_NEAR(p->h.knot[p->h.n].com_ref[1], 0.01, 0.02);
  for (int k = 1; k < p->h.n; ++k)
    for (int i = 0; i < 2; ++i) {
      const auto c = [&](int at) { return p->h.knot[at].com_ref[i]; };
      const double a = (c(k + 1) - 2 * c(k) + c(k - 1)) / (tasks::TalosStep::dt * tasks::TalosStep::dt);
      // c'' = (c - zmp) g / z, and the pressure is never farther than half a step and half a stance away
      EXPECT_LT(std::fabs(a), 9.81 / p->steps.height() * 0.2);
    }
}

TEST(Steps, StancesStandOnTheirFeet) {
  const auto p = two_steps();
  for (int i = 0; i <= 2; ++i) {
    RbdData<TalosSteps::R, double> d;
    rbd_kinematics<TalosSteps::R>(p->steps.stance(i), d);
    for (int f = 0; f < 2; ++f) {
      Mat3<double> R_WF;
      Vec3<double> at;
      rbd_frame_placement<TalosSteps::R>(d, TalosSteps::Contacts::frame[f], R_WF, at);
      const Placement wanted = i == 0 ? p->steps.placement(f, 0) : p->steps.placement(f, i < 2 ? p->steps.begins(i) : p->h.n);
      for (int e = 0; e < 3; ++e) EXPECT_NEAR(at[e], wanted.p[e], 1e-4);  // what plan() promises
      EXPECT_NEAR(std::atan2(R_WF(1, 0), R_WF(0, 0)), wanted.yaw, 1e-4);
    }
  }
}

TEST(Steps, FeetOutOfReachAreRefused) {
  TalosSteps steps;
  const Placement start[2] = {{{0.0, 2.0, 0.0}, 0.0}, {{0.0, -2.0, 0.0}, 0.0}};
  const int foot[1] = {0};
  EXPECT_EQ(steps.plan(start, 1, foot, start), StepsFault::kNoPosture);
}

TEST(Steps, AFootOnTheOtherOneIsRefused) {
  TalosSteps steps;
  const Placement start[2] = {{{0.0, 0.1, 0.0}, 0.0}, {{0.0, -0.1, 0.0}, 0.0}};
  const int foot[1] = {0};
  const auto goes = [&](double x, double y, double yaw) {
    const Placement goal = {{x, y, 0.0}, yaw};
    return steps.plan(start, 1, foot, &goal);
  };
  const double half[2] = {tasks::TalosStep::sole_half[0], tasks::TalosStep::sole_half[1]};
  EXPECT_EQ(goes(0.0, -0.1, 0.0), StepsFault::kOverlap);
  EXPECT_EQ(goes(0.0, -0.1 + 2.0 * half[1] - 1e-3, 0.0), StepsFault::kOverlap);
  EXPECT_EQ(goes(0.0, -0.1 + 2.0 * half[1] + 1e-2, 0.0), StepsFault::kNone);
  EXPECT_EQ(goes(0.0, -0.1 + 2.0 * half[1] + 1e-2, 0.4), StepsFault::kOverlap);  // its heel
}

}  // namespace
}  // namespace engram
