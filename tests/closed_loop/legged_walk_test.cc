// link: engram_talos_walk legged_plant
// Talos in MuJoCo: walks at the commanded velocity, turns through the heading where angles jump, stops and stands.
#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/legged_plant.h"

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

}  // namespace
}  // namespace engram::test
