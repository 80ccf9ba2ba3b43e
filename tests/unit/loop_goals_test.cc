// The memory as a metric: the goal with the cheapest guess is chosen, and nothing else decides.
#include "controller/loop/loop_goals.h"

#include "controller/loop/loop_plan.h"
#include "controller/loop/loop_reach.h"
#include "tables/panda_reach/task.h"

#include <gtest/gtest.h>

#include <cmath>

namespace engram::test {
namespace {

using Task = tasks::PandaReach;
using Model = ReachModel<Task, void>;
using P = Model::P;
constexpr int N = Model::N, kGuesses = 2;

struct GoalsTest : testing::Test {
  double x0[P::nx] = {};
  ReachTarget goal[3];
  Seed<P, N> still, elsewhere;
  Horizon<P, N> horizon;
  Candidate<P> scratch[kGuesses];
  double merit[3], last_t[N + 1];

  // Goals 30, 0 and 60 cm above the hand.
  GoalsTest() {
    for (int i = 0; i < P::nq; ++i) x0[i] = robots::Panda::q_home[i];
    Mat3<double> R_WH;
    Vec3<double> p_WH;
    reach_hand<Task>(x0, R_WH, p_WH);
    for (int g = 0; g < 3; ++g) {
      for (int i = 0; i < 3; ++i) goal[g].p[i] = p_WH[i] + (i == 2 ? (g == 0 ? 0.3 : g == 1 ? 0.0 : 0.6) : 0.0);
      for (int i = 0; i < 9; ++i) goal[g].R[i] = R_WH(i / 3, i % 3);
    }
    stand_still<P, N>(x0, still);
    elsewhere = still;
    for (auto& x : elsewhere.x) x[0] += 0.5;
  }
  // For every goal: standing still, and a worse guess before it.
  int ask(const ReachTarget&, const double* t, Candidate<P>* candidates) {
    std::memcpy(last_t, t, sizeof last_t);
    candidates[0] = {ENGRAM_CANDIDATE_KNN, elsewhere.x, elsewhere.u, 0, 0, 0};
    candidates[1] = {ENGRAM_CANDIDATE_COLD, still.x, still.u, 0, 0, 0};
    return 2;
  }
  template <class Ask> int choose(int n, Ask ask) { return loop_choose_goal<Model>(goal, n, x0, ask, merit, horizon, scratch); }
};

TEST_F(GoalsTest, TheNearestGoalIsTheCheapestForWhoStandsStill) {
  const auto all = [this](auto&&... a) { return ask(a...); };
  EXPECT_EQ(choose(3, all), 1);
  EXPECT_LT(merit[1], merit[0]);
  EXPECT_LT(merit[0], merit[2]);
  EXPECT_EQ(last_t[0], 0);
  EXPECT_DOUBLE_EQ(last_t[N], N * Task::dt);
  EXPECT_EQ(choose(1, all), 0);
}

TEST_F(GoalsTest, AGoalWithoutAGuessIsNotChosen) {
  const auto not_the_second = [this](const ReachTarget& g, const double* t, Candidate<P>* c) {
    return &g == &goal[1] ? 0 : ask(g, t, c);
  };
  EXPECT_EQ(choose(3, not_the_second), 0);
  EXPECT_TRUE(std::isinf(merit[1]));
  EXPECT_EQ(choose(3, [](auto&&...) { return 0; }), -1);
  EXPECT_EQ(choose(0, not_the_second), -1);
}

TEST_F(GoalsTest, AGuessThatIsNotFiniteDoesNotCount) {
  still.x[3][1] = NAN;
  elsewhere.x[0][0] = NAN;
  EXPECT_EQ(choose(3, [this](auto&&... a) { return ask(a...); }), -1);
}

}  // namespace
}  // namespace engram::test
