// The memory of steps on the tables of the tree: frames do not matter, the right foot is the left one mirrored, bad input.
// link: engram_tab engram_tables_talos_step
#include "controller/memory/step_memory.h"

#include "tables/talos_step/tables.h"
#include "tables/talos_step/task.h"

#include <gtest/gtest.h>

#include <memory>

namespace engram {
namespace {

using Task = tasks::TalosStep;
using R = Task::Robot;
constexpr int nq = R::nq, nv = R::nv, nu = R::nu;
const StepTables kTables = {&talos_step_regression_v1, &talos_step_path_v1, &talos_step_torque_v1};

struct Query {
  StepTask task = {{{0.02, 0.09, 0.05}, {-0.02, -0.09, -0.05}}, {0.2, 0.1, 0.1}};
  int at = 0;
  double x0[nq + nv] = {};
  std::unique_ptr<StepWork<Task>> work = std::make_unique<StepWork<Task>>();
  std::unique_ptr<StepGuess<Task>> guess = std::make_unique<StepGuess<Task>>();

  Query() { std::memcpy(x0, R::q_home, sizeof(R::q_home)); }
  bool ask(const StepTables& tables = kTables) { return step_query<Task, TalosMirror>(tables, task, at, x0, *work, *guess); }
};

TEST(StepMemory, TheTablesOfTheTreeFit) {
  char text[TAB_TEXT];
  EXPECT_EQ(step_check<Task>(kTables, text), kTabOk) << text;
  const StepTables swapped = {&talos_step_regression_v1, &talos_step_torque_v1, &talos_step_path_v1};
  EXPECT_EQ(step_check<Task>(swapped, text), kTabBad);
  EXPECT_NE(std::string(text).find("engram fit talos step"), std::string::npos) << text;
  const StepTables missing = {nullptr, &talos_step_path_v1, &talos_step_torque_v1};
  EXPECT_EQ(step_check<Task>(missing, text), kTabBad);
}

TEST(StepMemory, StartsWhereTheRobotIsAndMovesAsTheIntegratorDoes) {
  Query q;
  ASSERT_TRUE(q.ask());
  EXPECT_EQ(q.guess->status, kTabOk);
  EXPECT_EQ(std::memcmp(q.guess->x[0], q.x0, sizeof(q.x0)), 0);
  for (int k = 0; k < Task::nknots; ++k) {  // the integrator: q' = q (+) dt v'
    double dq[nv], next[nq];
    for (int i = 0; i < nv; ++i) dq[i] = Task::dt * q.guess->x[k + 1][nq + i];
    rbd_integrate<R>(q.guess->x[k], dq, next);
    for (int i = 0; i < nq; ++i) EXPECT_NEAR(next[i], q.guess->x[k + 1][i], 1e-12);
  }
}

TEST(StepMemory, FramesDoNotMatter) {
  Query here, there;
  const double c = std::cos(2.0), s = std::sin(2.0);
  const auto move = [&](double* p) {
    const double x = p[0], y = p[1];
    p[0] = 3.0 + c * x - s * y;
    p[1] = -1.0 + s * x + c * y;
    p[2] += 2.0;
  };
  for (auto& foot : there.task.feet) move(foot);
  move(there.task.goal);
  ASSERT_TRUE(here.ask() && there.ask());
  for (int k = 0; k < Task::nknots; ++k)
    for (int i = 0; i < nu; ++i) EXPECT_NEAR(here.guess->u[k][i], there.guess->u[k][i], 1e-3);  // features are floats
}

// Talos' halves differ by some grams: the torques of a mirrored step by less than 3 N m of some hundred.
TEST(StepMemory, TheRightFootMirrorsTheLeft) {
  Query left, right;
  right.task.foot = 1;
  for (int f = 0; f < 2; ++f)
    for (int i = 0; i < 3; ++i) right.task.feet[f][i] = (i == 0 ? 1.0 : -1.0) * left.task.feet[1 - f][i];
  for (int i = 1; i < 3; ++i) right.task.goal[i] = -left.task.goal[i];
  ASSERT_TRUE(left.ask() && right.ask());
  double largest = 0.0;
  for (int k = 0; k < Task::nknots; ++k)
    for (int i = 0; i < nu; ++i) {
      largest = std::fmax(largest, std::fabs(left.guess->u[k][i]));
      EXPECT_NEAR(right.guess->u[k][i], TalosMirror::sign[i] * left.guess->u[k][TalosMirror::other[i]], 3.0);
    }
  EXPECT_GT(largest, 50.0);
}

TEST(StepMemory, FarTasksAreSaidToBeFar) {
  Query q;
  q.task.goal[0] = 0.8;
  ASSERT_TRUE(q.ask());
  EXPECT_EQ(q.guess->status, kTabOutside);
}

TEST(StepMemory, WhatIsNotFiniteGivesNoGuess) {
  Query q;
  q.task.goal[1] = NAN;
  EXPECT_FALSE(q.ask());
  q = Query();
  q.x0[nq] = HUGE_VAL;
  EXPECT_FALSE(q.ask());
}

TEST(StepMemory, AStepOfAWalkIsShorterAndMayBeAskedFromAnyKnot) {
  Query q;
  EXPECT_EQ(step_first<Task>(q.task), 0);
  EXPECT_EQ(step_last<Task>(q.task), Task::nknots);
  q.task.from_walk = q.task.into_walk = true;
  const double stood[3] = {-0.2, -0.09, -0.05}, goes[3] = {0.4, -0.09, 0.1};
  std::memcpy(q.task.previous, stood, sizeof(stood));
  std::memcpy(q.task.next, goes, sizeof(goes));
  EXPECT_EQ(step_last<Task>(q.task) - step_first<Task>(q.task), Task::gait_swing + Task::gait_between);
  EXPECT_FALSE(q.ask());  // knot 0 is not one of its knots
  for (q.at = step_first<Task>(q.task); q.at < step_last<Task>(q.task); q.at += 5) {
    ASSERT_TRUE(q.ask());
    EXPECT_EQ(q.guess->first, q.at);
    EXPECT_EQ(q.guess->last, step_last<Task>(q.task));
    EXPECT_EQ(std::memcmp(q.guess->x[q.at], q.x0, sizeof(q.x0)), 0);
  }
  q.at = step_last<Task>(q.task);
  EXPECT_FALSE(q.ask());
}

}  // namespace
}  // namespace engram
