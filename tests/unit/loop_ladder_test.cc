// link: engram_panda_reach
// options: -O1
// Every rung of the fall-back ladder is reached by an injected fault, is reported, and is left again.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "tests/support/panda_plant.h"

namespace engram::test {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();
const double kBad[7] = {0, 0, kNaN, 0, 0, 0, 0};

// Distance of the planned hand at a knot from the target.
double hand_error(const engram_cycle& c, int knot, const double* task) {
  const double* const p = c.path[knot];
  return std::hypot(p[0] - task[0], p[1] - task[1], p[2] - task[2]);
}

class LadderTest : public testing::Test {
 protected:
  void SetUp() override { ASSERT_EQ(controller.error, ENGRAM_NO_ERROR); }
  void run(int milliseconds) {
    for (int i = 0; i < milliseconds; ++i) {
      controller.step(plant);
      for (double t : controller.tau) ASSERT_TRUE(std::isfinite(t));
    }
  }
  engram_status task(const double* value, int jump) { return engram_set_task(controller.handle, plant.utime, jump, value, 7); }
  // Steps of `utime` without a feedback: what the fast side does on its own.
  engram_status command(const double* q, const double* v) {
    plant.utime += 1000;
    return engram_command(controller.handle, plant.utime, q, v, controller.tau);
  }

  PandaPlant plant;
  PandaController controller;
};

TEST_F(LadderTest, HoldsWithoutATask) {
  run(100);
  EXPECT_EQ(controller.cycle().status, ENGRAM_NO_TASK);
  EXPECT_EQ(controller.cycle().rung, ENGRAM_RUNG_HOLD);
  for (int i = 0; i < 7; ++i) EXPECT_NEAR(plant.q[i], PandaPlant::R::q_home[i], 1e-6);  // gravity is compensated exactly
}

TEST_F(LadderTest, ThePlanEndsAtTheTarget) {
  run(20);
  EXPECT_EQ(task(kTaskNear, 1), ENGRAM_CONVERGED);
  run(200);
  const engram_cycle c = controller.cycle();
  EXPECT_EQ(c.rung, ENGRAM_RUNG_PLAN);
  EXPECT_EQ(c.jump, 1);
  EXPECT_LT(hand_error(c, c.npath - 1, kTaskNear), 0.01);  // the tolerance of the task
  EXPECT_GT(c.clearance, 0.0);
}

TEST_F(LadderTest, ShiftedPlanWhenTheNewOneDoesNotArrive) {
  run(20);
  task(kTaskNear, 1);
  run(321);
  // a tick without prepare: the plan of before goes on
  engram_feedback(controller.handle, plant.utime, plant.q, plant.v);
  engram_feedback(controller.handle, plant.utime, plant.q, plant.v);
  EXPECT_EQ(controller.cycle().rung, ENGRAM_RUNG_SHIFTED);
  EXPECT_EQ(controller.cycle().status, ENGRAM_DEADLINE);
  run(100);
  EXPECT_EQ(controller.cycle().rung, ENGRAM_RUNG_PLAN);
}

TEST_F(LadderTest, HoldsWhenThePlannerDies) {
  run(20);
  task(kTaskNear, 1);
  run(300);
  engram_status status = ENGRAM_CONVERGED;
  for (int i = 0; i < 800; ++i) {
    status = engram_command(controller.handle, plant.utime, plant.q, plant.v, controller.tau);
    plant.step(controller.tau);
  }
  EXPECT_EQ(status, ENGRAM_STALE_PLAN);
  for (double v : plant.v) EXPECT_LT(std::fabs(v), 0.02);  // 700 ms of holding at 10 rad/s leave 6 exp(-7) of the motion
  engram_feedback(controller.handle, plant.utime, plant.q, plant.v);
  EXPECT_EQ(controller.cycle().rung, ENGRAM_RUNG_HOLD);  // worst rung since the last cycle
}

TEST_F(LadderTest, BadStatesDescendToOffAndBack) {
  run(20);
  task(kTaskNear, 1);
  run(301);
  engram_options o;
  engram_default_options(&engram_panda_reach, &o);
  double before[7];
  std::memcpy(before, controller.tau, sizeof before);
  // first the plan without feedback
  EXPECT_EQ(command(kBad, plant.v), ENGRAM_BAD_STATE);
  for (int i = 0; i < 7; ++i) EXPECT_NEAR(controller.tau[i], before[i], 5.0);  // N m: no leap
  // then gravity compensation at the last good posture
  for (int64_t t = 0; t < o.state_gap_us; t += 1000) EXPECT_EQ(command(plant.q, kBad), ENGRAM_BAD_STATE);
  double g[7], pack[7];
  RbdData<PandaPlant::R, double> d;
  const double rest[7] = {};
  rbd_rnea<PandaPlant::R>(plant.q, rest, rest, d, g);
  for (int t = 0; t < 50; ++t) command(kBad, kBad);
  for (int i = 0; i < 7; ++i) EXPECT_NEAR(controller.tau[i], g[i], 0.5);  // N m: plant.q moved for a step since
  std::memcpy(pack, controller.tau, sizeof pack);
  engram_feedback(controller.handle, plant.utime, kBad, plant.v);
  EXPECT_EQ(controller.cycle().rung, ENGRAM_RUNG_DAMPING);
  EXPECT_EQ(controller.cycle().status, ENGRAM_STALE_STATE);
  // then nothing
  for (int64_t t = 0; t < o.off_after_us; t += 1000) command(kBad, kBad);
  for (double t : controller.tau) EXPECT_EQ(t, 0.0);
  engram_feedback(controller.handle, plant.utime, kBad, kBad);
  EXPECT_EQ(controller.cycle().rung, ENGRAM_RUNG_OFF);
  // a good state again: up the ladder
  plant.utime = plant.utime / 10000 * 10000 + 10000;
  std::memset(plant.v, 0, sizeof plant.v);
  run(300);
  EXPECT_EQ(controller.cycle().rung, ENGRAM_RUNG_PLAN);
}

TEST_F(LadderTest, NoStateEverMeansNoTorque) {
  EXPECT_EQ(command(kBad, kBad), ENGRAM_BAD_STATE);
  for (double t : controller.tau) EXPECT_EQ(t, 0.0);
}

TEST_F(LadderTest, OverspeedIsDamped) {
  run(20);
  task(kTaskNear, 1);
  run(100);
  for (int i = 0; i < 7; ++i) plant.v[i] = 1.9 * PandaPlant::R::v_max[i];
  engram_feedback(controller.handle, plant.utime, plant.q, plant.v);
  engram_command(controller.handle, plant.utime, plant.q, plant.v, controller.tau);
  engram_feedback(controller.handle, plant.utime, plant.q, plant.v);
  EXPECT_EQ(controller.cycle().rung, ENGRAM_RUNG_DAMPING);
}

TEST_F(LadderTest, AGapInTimeDropsThePlan) {
  run(20);
  task(kTaskNear, 1);
  run(301);
  plant.utime += 1000000 - plant.utime % 10000;  // the plant's clock went on without us
  controller.step(plant);
  EXPECT_EQ(controller.cycle().status, ENGRAM_STALE_STATE);
  EXPECT_EQ(controller.cycle().rung, ENGRAM_RUNG_HOLD);
  EXPECT_EQ(engram_plan(controller.handle, nullptr, nullptr, nullptr, nullptr), 0);
  run(300);
  EXPECT_EQ(controller.cycle().rung, ENGRAM_RUNG_PLAN);
}

TEST_F(LadderTest, TimeBackwardsIsAStaleState) {
  run(20);
  task(kTaskNear, 1);
  run(300);
  double before[7];
  std::memcpy(before, controller.tau, sizeof before);
  EXPECT_EQ(engram_command(controller.handle, plant.utime - 5000, plant.q, plant.v, controller.tau), ENGRAM_STALE_STATE);
  for (int i = 0; i < 7; ++i) EXPECT_EQ(controller.tau[i], before[i]);
  EXPECT_EQ(engram_feedback(controller.handle, plant.utime - 50000, plant.q, plant.v), ENGRAM_STALE_STATE);
}

TEST_F(LadderTest, TasksThatCannotBeAreRefused) {
  run(20);
  task(kTaskNear, 1);
  double bad[7];
  for (double value : {kNaN, kInfinity, -kInfinity}) {
    std::memcpy(bad, kTaskNear, sizeof bad);
    bad[4] = value;
    EXPECT_EQ(task(bad, 2), ENGRAM_BAD_TASK);
  }
  const double no_rotation[7] = {0.4, 0, 0.4, 0, 0, 0, 0};
  EXPECT_EQ(task(no_rotation, 2), ENGRAM_BAD_TASK);
  EXPECT_EQ(engram_set_task(controller.handle, plant.utime, 2, kTaskNear, 6), ENGRAM_BAD_TASK);
  run(100);
  EXPECT_EQ(controller.cycle().jump, 1);  // the last good task stays
  EXPECT_EQ(controller.cycle().rung, ENGRAM_RUNG_PLAN);
}

TEST_F(LadderTest, ATargetOutOfReachIsApproachedWithoutAlarm) {
  run(20);
  const double far[7] = {2.0, 0.0, 0.5, 1, 0, 0, 0};
  EXPECT_EQ(task(far, 1), ENGRAM_TASK_FAR);
  double nearest = 1e3;
  for (int i = 0; i < 25; ++i) {
    run(10);
    const engram_cycle c = controller.cycle();
    for (int k = 0; k < c.nguess; ++k) EXPECT_NE(c.guess[k], ENGRAM_CANDIDATE_KNN);  // the memory was not asked
    if (c.rung == ENGRAM_RUNG_PLAN) {
      EXPECT_GT(c.clearance, 0.0);
    }
    nearest = std::min(nearest, hand_error(c, 0, far));
  }
  EXPECT_LT(nearest, 1.7);  // m: 1.69 at home; the shelf stands in the way
  // and back to work
  EXPECT_EQ(task(kTaskNear, 2), ENGRAM_CONVERGED);
  run(100);
  EXPECT_EQ(controller.cycle().jump, 2);
}

TEST_F(LadderTest, APlanThroughAnObstacleIsNotExecuted) {
  run(20);
  const double inside[7] = {0.62, 0.0, 0.40, 1, 0, 0, 0};  // inside the middle board of the shelf
  task(inside, 1);
  for (int i = 0; i < 25; ++i) {
    run(10);
    const engram_cycle c = controller.cycle();
    if (c.rung == ENGRAM_RUNG_PLAN) {
      EXPECT_GE(c.clearance, 0.0) << "at " << plant.utime;
    }
  }
}

}  // namespace
}  // namespace engram::test
