// link: engram_anymal_trot legged_plant
// ANYmal in MuJoCo: trots at the commanded velocity whichever way it looks, takes pushes, stops and stands.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/support/legged_plant.h"

namespace engram::test {
namespace {

const engram_model* const kModel = &engram_anymal_trot;

struct TrotTest : testing::Test {
  void run(LeggedPlant& plant, LeggedController& c, int end) {
    for (auto t = static_cast<int>(plant.utime / 1000); t < end; ++t) {
      c.step(plant);
      for (size_t i = 0; i < c.tau.size(); ++i) ASSERT_LE(std::fabs(c.tau[i]), plant.model()->actuator_ctrlrange[2 * i + 1]);
      ASSERT_GT(plant.base_up(), 0.9) << "fallen at " << t << " ms";
    }
  }
  static void ask(LeggedPlant& plant, LeggedController& c, double vx, double vy, double wz, double gait) {
    const double task[4] = {vx, vy, wz, gait};
    EXPECT_EQ(engram_set_task(c.handle, plant.utime, 1, task, 4), ENGRAM_CONVERGED);
  }
};

TEST_F(TrotTest, KeepsTheVelocityTurnsAndStops) {
  constexpr double kHeading = 0.5 * M_PI, kSpeed = 0.6;
  LeggedPlant plant(kModel, kHeading);
  LeggedController c(kModel);
  run(plant, c, 100);
  EXPECT_EQ(c.cycle().rung, ENGRAM_RUNG_HOLD);
  ask(plant, c, kSpeed, 0.0, 0.0, 1.0);
  run(plant, c, 2000);
  const double x = plant.com[0], y = plant.com[1];
  run(plant, c, 4000);
  EXPECT_NEAR((plant.com[1] - y) / 2.0, kSpeed, 0.02);  // m/s: a stride is not over when the clock is
  EXPECT_NEAR((plant.com[0] - x) / 2.0, 0.0, 0.01);
  ask(plant, c, 0.0, 0.0, 0.4, 1.0);
  const double yaw = plant.yaw();
  run(plant, c, 6000);
  EXPECT_NEAR(plant.yaw() - yaw, 0.8, 0.1);  // rad
  ask(plant, c, 0.0, 0.0, 0.0, 0.0);
  run(plant, c, 8000);
  EXPECT_LT(std::hypot(plant.com_velocity[0], plant.com_velocity[1], plant.com_velocity[2]), 0.01);  // m/s: stands
  EXPECT_EQ(c.cycle().rung, ENGRAM_RUNG_PLAN);
}

TEST_F(TrotTest, TakesLateralPushesAtAnyPhase) {
  struct {
    double heading, impulse;  // rad, N s
    int at;                   // ms
  } const pushes[] = {{0.0, 15.0, 1500}, {M_PI, -15.0, 1630}, {0.4, 25.0, 1540}, {0.4, -25.0, 1780}};
  for (const auto& push : pushes) {
    LeggedPlant plant(kModel, push.heading);
    LeggedController c(kModel);
    run(plant, c, 100);
    ask(plant, c, 0.3, 0.0, 0.0, 1.0);
    run(plant, c, push.at);
    plant.push("root_joint", {-std::sin(push.heading) * push.impulse / 0.1, std::cos(push.heading) * push.impulse / 0.1, 0.0});
    run(plant, c, push.at + 100);
    plant.push("root_joint", {0.0, 0.0, 0.0});
    run(plant, c, push.at + 2500);
    EXPECT_GT(plant.com[2], 0.4);
    EXPECT_EQ(c.cycle().rung, ENGRAM_RUNG_PLAN);
  }
}

}  // namespace
}  // namespace engram::test
