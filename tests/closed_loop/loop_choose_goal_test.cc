// link: engram_panda_reach
// The memory as a metric, behind the door: of several goals, the one that is cheapest to reach; asking changes no command.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "tables/panda_reach/task.h"
#include "tests/support/panda_plant.h"

namespace engram::test {
namespace {

const engram_model* const kModel = &engram_panda_reach;

TEST(Door, ChoosesTheGoalThatIsCheapestToReach) {
  PandaController a, b;
  PandaPlant plant_a, plant_b;
  double goals[4][7], merit[4];
  std::memcpy(goals[0], kTaskRight, sizeof goals[0]);
  std::memcpy(goals[1], kTaskNear, sizeof goals[1]);
  std::memcpy(goals[2], kTaskNear, sizeof goals[2]);
  std::memcpy(goals[3], kTaskNear, sizeof goals[3]);
  goals[2][0] = 5.0;  // out of reach
  goals[3][6] = NAN;
  EXPECT_GE(engram_choose_goal(a.handle, plant_a.q, plant_a.v, goals[0], 2, merit), 0);
  EXPECT_EQ(engram_choose_goal(a.handle, plant_a.q, plant_a.v, goals[2], 2, merit), -1);
  EXPECT_TRUE(std::isinf(merit[0]) && std::isinf(merit[1]));
  EXPECT_EQ(engram_choose_goal(a.handle, plant_a.q, plant_a.v, goals[0], 0, merit), -1);
  for (const int at : {1, 0}) {
    engram_set_task(a.handle, plant_a.utime, 2 - at, goals[at], 7);
    engram_set_task(b.handle, plant_b.utime, 2 - at, goals[at], 7);
    for (int i = 0; i < 2500; ++i) {
      if (plant_a.utime % engram_describe(kModel)->tick_us == 0) {
        EXPECT_EQ(engram_feedback(a.handle, plant_a.utime, plant_a.q, plant_a.v), engram_feedback(b.handle, plant_b.utime, plant_b.q, plant_b.v));
        if (i % 500 == 0) (void)engram_choose_goal(a.handle, plant_a.q, plant_a.v, goals[0], 4, merit);
        engram_prepare(a.handle, plant_a.utime + engram_describe(kModel)->tick_us);
        engram_prepare(b.handle, plant_b.utime + engram_describe(kModel)->tick_us);
        EXPECT_EQ(engram_choose_goal(b.handle, plant_b.q, plant_b.v, goals[0], 4, merit), -1);  // a period is under way
      }
      engram_command(a.handle, plant_a.utime, plant_a.q, plant_a.v, a.tau);
      engram_command(b.handle, plant_b.utime, plant_b.q, plant_b.v, b.tau);
      ASSERT_EQ(std::memcmp(a.tau, b.tau, sizeof a.tau), 0) << "at step " << i;
      plant_a.step(a.tau);
      plant_b.step(b.tau);
    }
    engram_feedback(a.handle, plant_a.utime, plant_a.q, plant_a.v);
    EXPECT_EQ(engram_choose_goal(a.handle, plant_a.q, plant_a.v, goals[0], 4, merit), at);
    EXPECT_LT(merit[at], 0.5 * merit[1 - at]);
    EXPECT_TRUE(std::isinf(merit[2]) && std::isinf(merit[3]));
    engram_feedback(b.handle, plant_b.utime, plant_b.q, plant_b.v);
    engram_prepare(a.handle, plant_a.utime + engram_describe(kModel)->tick_us);
    engram_prepare(b.handle, plant_b.utime + engram_describe(kModel)->tick_us);
  }
}

}  // namespace
}  // namespace engram::test
