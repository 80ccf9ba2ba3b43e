// A query of the memory of steps asks for no heap. (Not a unit test: the sanitizers have an allocator of their own.)
// link: engram_tab engram_tables_talos_step
// options: -O1
#include "controller/memory/step_memory.h"

#include "tables/talos_step/tables.h"
#include "tables/talos_step/task.h"
#include "tests/support/count_heap.h"

#include <gtest/gtest.h>

#include <memory>

namespace engram {
namespace {

using Task = tasks::TalosStep;

TEST(StepMemory, AsksForNoHeap) {
  const StepTables tables = {&talos_step_regression_v1, &talos_step_path_v1, &talos_step_torque_v1};
  const StepTask task = {{{0.02, 0.09, 0.05}, {-0.02, -0.09, -0.05}}, {0.2, 0.1, 0.1}};
  double x0[Task::Robot::nq + Task::Robot::nv] = {};
  std::memcpy(x0, Task::Robot::q_home, sizeof(Task::Robot::q_home));
  const auto work = std::make_unique<StepWork<Task>>();
  const auto guess = std::make_unique<StepGuess<Task>>();
  counting = true;
  const bool found = step_query<Task, TalosMirror>(tables, task, 0, x0, *work, *guess);
  counting = false;
  EXPECT_TRUE(found);
  EXPECT_EQ(calls, 0);
}

}  // namespace
}  // namespace engram
