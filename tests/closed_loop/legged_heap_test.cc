// link: engram_talos_stand engram_talos_walk engram_anymal_trot legged_plant
// No heap in the control period of robots on legs: every allocator of the process is counted over a closed loop with a task and a push.
#include <gtest/gtest.h>

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

}  // namespace
}  // namespace engram::test
