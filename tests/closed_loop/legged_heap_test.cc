// link: engram_talos_stand engram_talos_walk engram_anymal_trot engram_hector_fly engram_pendulum_swing engram_unicycle_park engram_bicopter_fly legged_plant engram_sim
// No heap in the control period of robots on legs, of one that flies, of formulas: every allocator of the process is counted over a closed
// loop with a task and a push.
#include <gtest/gtest.h>

#include "sim_harness/sim_flight.h"
#include "sim_harness/sim_formula.h"
#include "tests/support/count_heap.h"
#include "tests/support/legged_plant.h"

namespace engram::test {
namespace {

// Calls of the allocators over 1.5 s: task at 0.1 s, push of 10 N s to the left at 1 s.
long long calls_of(const engram_model* model, const char* pushed, std::vector<double> task) {
  LeggedPlant plant(model, 0.3);
  LeggedController c(model);
  EXPECT_EQ(c.error, ENGRAM_NO_ERROR);
  calls = 0;
  counting = true;
  for (int t = 0; t < 1500; ++t) {
    if (t == 100) engram_set_task(c.handle, plant.utime, 1, task.data(), static_cast<int32_t>(task.size()));
    if (t == 1000 || t == 1100) plant.push(pushed, {0.0, t == 1000 ? 100.0 : 0.0, 0.0});
    c.step(plant);
  }
  counting = false;
  EXPECT_EQ(c.cycle().rung, ENGRAM_RUNG_PLAN);  // the loop was alive
  EXPECT_GT(plant.base_up(), 0.95);
  return calls;
}

TEST(LeggedHeap, ThePlantedNewIsSeen) {
  calls = 0;
  counting = true;
  int* volatile planted = new int(1);
  delete planted;
  counting = false;
  EXPECT_EQ(calls, 2);
}

TEST(LeggedHeap, StandingAndSquattingAllocatesNothing) { EXPECT_EQ(calls_of(&engram_talos_stand, "torso_2_joint", {0.0, 0.1, 0.5}), 0); }
TEST(LeggedHeap, WalkingAllocatesNothing) { EXPECT_EQ(calls_of(&engram_talos_walk, "torso_2_joint", {0.2, 0.0, 0.1, 1.0}), 0); }
TEST(LeggedHeap, TrottingAllocatesNothing) { EXPECT_EQ(calls_of(&engram_anymal_trot, "root_joint", {0.3, 0.0, 0.2, 1.0}), 0); }

// The same in the CVODE plant, which has a heap of its own: the controller's calls alone are counted. Push of 2 N at 1 s.
long long calls_in_the_smooth_plant(const engram_model* model, std::vector<double> task) {
  const engram_description& about = *engram_describe(model);
  sim::Model plant;
  EXPECT_EQ(plant.load((std::string("tables/") + about.robot + "_" + about.task + "/scene.xml").c_str()), "");
  mj_resetDataKeyframe(plant.m, plant.d, 0);
  mj_forward(plant.m, plant.d);
  sim::Flight flight;
  sim::Formula formula;
  EXPECT_EQ(plant.formula.empty() ? flight.init(plant) : formula.init(plant), "");
  LeggedController c(model);
  EXPECT_EQ(c.error, ENGRAM_NO_ERROR);
  double q[sim::kMaxDof], v[sim::kMaxDof], tau[sim::kMaxDof] = {};
  engram_cycle cycle = {};
  calls = 0;
  for (int t = 0; t < 1500; ++t) {
    const int64_t utime = 1000 * t;
    plant.get_state(q, v);
    counting = true;
    if (t == 100) engram_set_task(c.handle, utime, 1, task.data(), static_cast<int32_t>(task.size()));
    if (t % 10 == 0) engram_feedback(c.handle, utime, q, v);
    engram_command(c.handle, utime, q, v, tau);
    if (t % 10 == 0) engram_prepare(c.handle, utime + 10000);
    engram_cycle_info(c.handle, &cycle);
    counting = false;
    plant.set_tau(tau);
    plant.d->xfrc_applied[6] = t >= 1000 && t < 1100 ? 2.0 : 0.0;
    EXPECT_EQ(formula.ready() ? formula.step(&plant) : flight.step(&plant), "");
    mj_kinematics(plant.m, plant.d);
  }
  EXPECT_EQ(cycle.rung, ENGRAM_RUNG_PLAN);  // the loop was alive
  EXPECT_GT(std::hypot(plant.d->qvel[0], plant.d->qvel[plant.nv - 1]), 1e-3);
  return calls;
}

TEST(SmoothHeap, FlyingAllocatesNothing) { EXPECT_EQ(calls_in_the_smooth_plant(&engram_hector_fly, {1.0, 0.5, 1.0, 0.7}), 0); }
TEST(SmoothHeap, SwingingUpAllocatesNothing) { EXPECT_EQ(calls_in_the_smooth_plant(&engram_pendulum_swing, {0.0}), 0); }
TEST(SmoothHeap, ParkingAllocatesNothing) { EXPECT_EQ(calls_in_the_smooth_plant(&engram_unicycle_park, {1.0, 1.0, 1.5}), 0); }
TEST(SmoothHeap, FlyingInThePlaneAllocatesNothing) { EXPECT_EQ(calls_in_the_smooth_plant(&engram_bicopter_fly, {2.0, 1.0}), 0); }

}  // namespace
}  // namespace engram::test
