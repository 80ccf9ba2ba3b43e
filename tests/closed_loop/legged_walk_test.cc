// link: engram_talos_walk legged_plant random_walk
// Talos in MuJoCo: walks at the commanded velocity, turns through the heading where angles jump, stops and stands. Its memory of steps is
// asked when a knot of a step enters the horizon; one of random numbers does no harm.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "tests/support/legged_plant.h"
#include "tests/support/random_walk.h"

namespace engram::test {
namespace {

const engram_model* const kModel = &engram_talos_walk;

TEST(WalkTest, WalksTurnsThroughHalfATurnAndStops) {
  constexpr double kHeading = 3.0, kSpeed = 0.3, kTurn = 0.3;  // rad, m/s, rad/s
  LeggedPlant plant(kModel, kHeading);
  LeggedController c(kModel);
  const auto ask = [&](double vx, double wz, double gait) {
    const double task[4] = {vx, 0.0, wz, gait};
    EXPECT_EQ(engram_set_task(c.handle, plant.utime, 1, task, 4), ENGRAM_CONVERGED);
  };
  const auto run = [&](int end) {
    for (auto t = static_cast<int>(plant.utime / 1000); t < end; ++t) {
      c.step(plant);
      for (size_t i = 0; i < c.tau.size(); ++i) ASSERT_LE(std::fabs(c.tau[i]), plant.model()->actuator_ctrlrange[2 * i + 1]);
      ASSERT_GT(plant.base_up(), 0.9) << "fallen at " << t << " ms";
    }
  };
  run(100);
  ask(kSpeed, kTurn, 1.0);
  run(3000);
  const double x = plant.com[0], y = plant.com[1], yaw = plant.yaw();
  run(4440);  // two steps of 0.72 s later
  EXPECT_NEAR(std::hypot(plant.com[0] - x, plant.com[1] - y) / 1.44, kSpeed, 0.05);          // m/s: along the arc's chord
  EXPECT_NEAR(std::remainder(plant.yaw() - yaw, 2.0 * M_PI), 1.44 * kTurn, 0.1);             // rad
  EXPECT_LT(std::fabs(std::remainder(plant.yaw() - kHeading, 2.0 * M_PI)), 1.5);             // no turn too many
  ask(0.0, 0.0, 0.0);
  run(7500);
  EXPECT_LT(std::hypot(plant.com_velocity[0], plant.com_velocity[1], plant.com_velocity[2]), 0.02);  // m/s: stands
  EXPECT_EQ(c.cycle().rung, ENGRAM_RUNG_PLAN);
}

// Every command acts 10 ms late. Answered by what the state will be, the walk is as without; if nothing is told, torques saturate.
TEST(WalkTest, CommandsThatActLateAreAnsweredByAPrediction) {
  const auto least_up = [](int64_t told) {
    LeggedPlant plant(kModel, 0.4);
    plant.delay(10);
    engram_options options;
    engram_default_options(kModel, &options);
    options.delay_us = told;
    LeggedController c(kModel, &options);
    const double stand[4] = {}, walk[4] = {0.3, 0.03, -0.2, 1.0};
    double up = 1.0, torque = 0.0;
    EXPECT_EQ(engram_set_task(c.handle, 0, 1, stand, 4), ENGRAM_CONVERGED);
    for (int t = 0; t < 2500 && up > 0.7; ++t) {
      if (t == 100) engram_set_task(c.handle, plant.utime, 2, walk, 4);
      c.step(plant);
      up = std::min(up, plant.base_up());
      for (size_t i = 0; t > 100 && i < c.tau.size(); ++i)
        torque = std::max(torque, std::fabs(c.tau[i]) / plant.model()->actuator_ctrlrange[2 * i + 1]);
    }
    return std::pair(up, torque);
  };
  const auto [up, torque] = least_up(10000);
  EXPECT_GT(up, 0.99);
  EXPECT_LT(torque, 0.9);
  EXPECT_GE(least_up(0).second, 1.0);  // its torques saturate
}

// What the memory said over some steps, while kKnots knots entered the horizon.
constexpr int kKnots = 60;
struct Tally {
  int asked = 0, won = 0, worse = 0;
  double up = 1.0, x = 0.0, y = 0.0;  // least; m, where the centre of mass came to
};
Tally walk(const engram_model* model, const double (&task)[4], engram_mode mode = ENGRAM_MODE_MEMORY) {
  LeggedPlant plant(model, 0.4);
  engram_options options;
  engram_default_options(model, &options);
  options.memory = mode;
  LeggedController c(model, &options);
  EXPECT_EQ(c.error, ENGRAM_NO_ERROR);
  const double stand[4] = {};
  EXPECT_EQ(engram_set_task(c.handle, 0, 1, stand, 4), ENGRAM_CONVERGED);
  Tally tally;
  for (int t = 0; t < 2500; ++t) {
    if (t == 100) engram_set_task(c.handle, plant.utime, 2, task, 4);
    if (t == 1500) plant.push("torso_2_joint", {0.0, 60.0, 0.0});
    if (t == 1600) plant.push("torso_2_joint", {0.0, 0.0, 0.0});
    const bool ticks = plant.utime % 10000 == 0;
    c.step(plant);
    tally.up = std::min(tally.up, plant.base_up());
    const engram_cycle& cycle = c.cycle();
    if (!ticks || cycle.nguess < 2) continue;
    const bool memory = cycle.winner == ENGRAM_CANDIDATE_GPR;
    ++tally.asked;
    tally.won += memory;
    tally.worse += !(cycle.merit[memory] <= cycle.merit[0]);
  }
  tally.x = plant.com[0];
  tally.y = plant.com[1];
  return tally;
}

TEST(WalkMemory, ContinuesThePlanAndIsNeverWorse) {
  const Tally tally = walk(kModel, {0.3, 0.03, -0.2, 1.0});
  EXPECT_GT(tally.up, 0.98);
  EXPECT_GE(tally.asked, kKnots - 3);
  EXPECT_GT(tally.won, tally.asked / 2);
  EXPECT_EQ(tally.worse, 0);
}

// Backward, aside and around at once: steps that the memory has not learnt.
TEST(WalkMemory, FarStepsAreWalkedByTheShiftedPlan) {
  const Tally tally = walk(kModel, {-0.2, 0.1, 0.3, 1.0});
  EXPECT_LT(tally.asked, kKnots - 15);
  EXPECT_GT(tally.up, 0.98);
}

TEST(WalkMemory, TablesWithAnotherDigestAreRefused) {
  EXPECT_EQ(LeggedController(random_walk(false)).error, ENGRAM_ERROR_TABLES);
}

TEST(WalkMemory, RandomTablesDoNoHarm) {
  const Tally random = walk(random_walk(), {0.3, 0.03, -0.2, 1.0}), shift = walk(kModel, {0.3, 0.03, -0.2, 1.0}, ENGRAM_MODE_SHIFT);
  EXPECT_GE(random.asked, kKnots - 3);
  EXPECT_EQ(random.worse, 0);
  EXPECT_EQ(shift.asked, 0);
  EXPECT_GT(random.up, 0.98);
  EXPECT_NEAR(random.x, shift.x, 0.01);
  EXPECT_NEAR(random.y, shift.y, 0.01);
}

}  // namespace
}  // namespace engram::test
