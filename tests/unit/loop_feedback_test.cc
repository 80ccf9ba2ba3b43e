// link: engram_panda_reach
// options: -O1
// The torque of the fast side: tau = u* - K (x (-) x*), its sign by finite differences, the clamp and the rate limit.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "tests/support/panda_plant.h"

namespace engram::test {
namespace {

// A controller under way, stopped just after the feedback of a tick.
struct FeedbackTest : testing::Test {
  static constexpr int nv = 7;
  PandaPlant plant;
  engram_options options;
  FeedbackTest() { engram_default_options(&engram_panda_reach, &options); }

  void go(PandaController& c) {
    ASSERT_EQ(c.error, ENGRAM_NO_ERROR);
    for (int i = 0; i < 330; ++i) {
      if (i == 20) engram_set_task(c.handle, plant.utime, 1, kTaskNear, 7);
      c.step(plant);
    }
    engram_feedback(c.handle, plant.utime, plant.q, plant.v);
    ASSERT_EQ(c.cycle().rung, ENGRAM_RUNG_PLAN);
  }

  // State at time t of the first knot of a plan: constant acceleration.
  static void on_plan(const double* x, const int64_t* utime, int64_t t, double* state) {
    const double dt = 1e-6 * static_cast<double>(utime[1] - utime[0]), s = 1e-6 * static_cast<double>(t - utime[0]);
    for (int i = 0; i < nv; ++i) {
      const double a = (x[2 * nv + nv + i] - x[nv + i]) / dt;
      state[i] = x[i] + s * x[nv + i] + 0.5 * s * s * a;
      state[nv + i] = x[nv + i] + s * a;
    }
  }
};

TEST_F(FeedbackTest, GainsAreMinusTheSlopeOfTheTorque) {
  options.torque_rate = 1e9;  // no limit in the way
  PandaController c(&options);
  go(c);
  const engram_description& about = *engram_describe(&engram_panda_reach);
  std::vector<double> K(static_cast<size_t>(about.knots * about.nu * 2 * about.nv)),
      x(static_cast<size_t>((about.knots + 1) * 14)), u(static_cast<size_t>(about.knots * about.nu));
  std::vector<int64_t> utime(static_cast<size_t>(about.knots + 1));
  ASSERT_EQ(engram_plan(c.handle, utime.data(), x.data(), u.data(), K.data()), about.knots);
  EXPECT_EQ(utime[0], plant.utime);

  double tau[nv], plus[nv], minus[nv];
  engram_command(c.handle, utime[0], x.data(), x.data() + nv, tau);
  for (int i = 0; i < nv; ++i) EXPECT_NEAR(tau[i], u[static_cast<size_t>(i)], 1e-9);  // on the plan: the planned torque
  // The torque of a state that is off the plan by `step` in coordinate j, a microsecond later each time (torques have a rate).
  int64_t t = utime[0];
  const auto probe = [&](int j, double step, double* torque) {
    double state[2 * nv];
    on_plan(x.data(), utime.data(), ++t, state);
    state[j] += step;
    engram_command(c.handle, t, state, state + nv, torque);
  };
  constexpr double kStep = 1e-4;  // the law is linear: any step that stays within the torque limits
  double largest = 0;
  for (int j = 0; j < 2 * nv; ++j) {
    probe(j, kStep, plus);
    probe(j, -kStep, minus);
    for (int i = 0; i < nv; ++i) {
      const double slope = (plus[i] - minus[i]) / (2 * kStep), gain = K[static_cast<size_t>(i * 2 * nv + j)];
      EXPECT_NEAR(slope, -gain, 1e-5 * (1 + std::fabs(gain)));  // rounding of the torque over the step
      largest = std::max(largest, std::fabs(gain));
    }
  }
  EXPECT_GT(largest, 10.0);  // N m/rad: there is a feedback at all
}

TEST_F(FeedbackTest, TheReferenceMovesAlongThePlan) {
  options.torque_rate = 1e9;
  PandaController c(&options);
  go(c);
  std::vector<double> x(51 * 14), u(50 * 7);
  std::vector<int64_t> utime(51);
  ASSERT_EQ(engram_plan(c.handle, utime.data(), x.data(), u.data(), nullptr), 50);
  double state[2 * nv], tau[nv];
  for (int64_t t = utime[0]; t < utime[1]; t += 1000) {
    on_plan(x.data(), utime.data(), t, state);
    engram_command(c.handle, t, state, state + nv, tau);
    for (size_t i = 0; i < nv; ++i) EXPECT_NEAR(tau[i], u[i], 1e-9);
  }
}

TEST_F(FeedbackTest, TorqueIsClampedAndItsRateIsLimited) {
  options.torque_rate = 5.0;  // of the limit per second
  PandaController c(&options);
  go(c);
  double before[nv], tau[nv], pushed[nv];
  std::memcpy(before, c.tau, sizeof before);
  std::memcpy(pushed, plant.q, sizeof pushed);
  for (double& q : pushed) q += 0.5;  // rad: asks for far more than the limit
  int64_t t = plant.utime;
  for (int i = 0; i < 400; ++i, t += 1000) {
    if (i % 10 == 0) engram_feedback(c.handle, t, plant.q, plant.v);  // keeps the plan fresh
    engram_command(c.handle, t, pushed, plant.v, tau);
    for (int k = 0; k < nv; ++k) {
      EXPECT_LE(std::fabs(tau[k]), PandaPlant::R::u_max[k]);
      EXPECT_LE(std::fabs(tau[k] - before[k]), 5.0 * PandaPlant::R::u_max[k] * 1e-3 + 1e-9);
    }
    std::memcpy(before, tau, sizeof before);
  }
}

}  // namespace
}  // namespace engram::test
