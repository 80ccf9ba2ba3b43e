// link: engram_panda_reach
// Which guess seeds the solver: lowest merit, no flutter, other ends; and a memory that talks nonsense harms nobody.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "controller/loop/loop_controller.h"
#include "controller/loop/loop_planner.h"
#include "controller/loop/loop_reach.h"
#include "tables/panda_reach/task.h"
#include "tests/support/panda_plant.h"

namespace engram::test {
namespace {

using Task = tasks::PandaReach;
constexpr int N = Task::nknots;

// Proposes trajectories that no solver should be given.
struct NonsenseMemory {
  static constexpr int kGuesses = 4;
  double x[kGuesses][N + 1][14], u[kGuesses][N][7];
  static bool tables_fit() { return true; }
  static uint64_t table_digest() { return 1; }
  template <class P>
  int guesses(const ReachTarget&, const Question&, const double* x0, int, const double*, Candidate<P>* candidates, int n) {
    constexpr double kBad[kGuesses] = {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(), 1e300,
                                       -1e155};
    for (int g = 0; g < kGuesses; ++g) {
      for (auto& row : x[g]) std::memcpy(row, x0, sizeof row);
      for (auto& row : u[g])
        for (double& value : row) value = 0.0;
      if (g % 2) x[g][20][3] = kBad[g];
      else u[g][20][3] = kBad[g];
      candidates[n++] = {ENGRAM_CANDIDATE_KNN, x[g], u[g], 1.0, 0.0, 0.0};
    }
    return n;
  }
};
using Nonsense = ReachModel<Task, NonsenseMemory>;
using P = Nonsense::P;

struct GuessesTest : testing::Test {
  Guesses<Nonsense> guesses;
  Seed<P, N> seed[4];

  void add(engram_candidate kind, double merit, double cost, double end) {
    Seed<P, N>& s = seed[guesses.n];
    for (auto& row : s.x) std::fill(std::begin(row), std::end(row), end);
    guesses.candidate[guesses.n++] = {kind, s.x, s.u, 0.0, merit, cost};
  }
};

TEST_F(GuessesTest, TheLowestMeritWins) {
  add(ENGRAM_CANDIDATE_COLD, 5, 5, 0);
  add(ENGRAM_CANDIDATE_KNN, 2, 2, 0);
  add(ENGRAM_CANDIDATE_LINE, 3, 3, 0);
  EXPECT_EQ(guesses.best(0.1), &guesses.candidate[1]);
}

TEST_F(GuessesTest, AShiftedPlanGivesWayOnlyToAClearlyBetterGuess) {
  add(ENGRAM_CANDIDATE_SHIFTED, 12, 10, 0);  // its gaps are forgiven: they close with the next step
  add(ENGRAM_CANDIDATE_KNN, 9.5, 9.5, 0);
  EXPECT_EQ(guesses.best(0.1)->kind, ENGRAM_CANDIDATE_SHIFTED);
  guesses.clear();
  add(ENGRAM_CANDIDATE_SHIFTED, 12, 10, 0);
  add(ENGRAM_CANDIDATE_KNN, 8.5, 8.5, 0);
  EXPECT_EQ(guesses.best(0.1)->kind, ENGRAM_CANDIDATE_KNN);
  guesses.clear();
  add(ENGRAM_CANDIDATE_SHIFTED, 12, 10, 0);
  add(ENGRAM_CANDIDATE_KNN, 11.5, 11.5, 0);
  EXPECT_EQ(guesses.best(0.0)->kind, ENGRAM_CANDIDATE_KNN);  // at a jump merit alone counts
}

TEST_F(GuessesTest, FurtherStartsEndElsewhere) {
  add(ENGRAM_CANDIDATE_KNN, 1, 1, 0.0);
  add(ENGRAM_CANDIDATE_KNN, 2, 2, 0.5 * kOtherEnd);  // the same optimum
  add(ENGRAM_CANDIDATE_KNN, 4, 4, 5 * kOtherEnd);
  add(ENGRAM_CANDIDATE_LINE, 3, 3, 2 * kOtherEnd);
  EXPECT_EQ(guesses.best(0.1), &guesses.candidate[0]);
  EXPECT_EQ(guesses.another(0), &guesses.candidate[3]);
  EXPECT_EQ(guesses.another(0), &guesses.candidate[2]);
  EXPECT_EQ(guesses.another(0), nullptr);
}

TEST_F(GuessesTest, RivalsComeInTurn) {
  add(ENGRAM_CANDIDATE_SHIFTED, 1, 1, 0.0);
  add(ENGRAM_CANDIDATE_KNN, 4, 4, 5 * kOtherEnd);
  add(ENGRAM_CANDIDATE_LINE, 3, 3, 2 * kOtherEnd);
  guesses.best(0.1);
  EXPECT_EQ(guesses.another(1), &guesses.candidate[1]);
}

TEST_F(GuessesTest, NothingFiniteIsNoGuess) {
  add(ENGRAM_CANDIDATE_KNN, HUGE_VAL, HUGE_VAL, 0);
  EXPECT_EQ(guesses.best(0.1), nullptr);
}

TEST(Nonsense, OfTheMemoryNeverSeedsTheSolver) {
  static constexpr engram_model kModel = loop_model<Nonsense, Planner<Nonsense>>("panda", "nonsense");
  std::vector<unsigned char> memory(engram_sizeof(&kModel));
  engram_controller* handle = nullptr;
  ASSERT_EQ(engram_init(&kModel, memory.data(), memory.size(), nullptr, &handle), ENGRAM_NO_ERROR);
  PandaPlant plant;
  engram_set_task(handle, 0, 1, kTaskNear, 7);
  double tau[7];
  engram_cycle cycle;
  for (int i = 0; i < 200; ++i) {
    const bool tick = i % 10 == 0;
    const int64_t now = plant.utime;
    if (tick) engram_feedback(handle, now, plant.q, plant.v);
    engram_command(handle, now, plant.q, plant.v, tau);
    for (double t : tau) ASSERT_TRUE(std::isfinite(t));
    plant.step(tau);
    if (tick) {
      engram_prepare(handle, now + 10000);
      engram_cycle_info(handle, &cycle);
      EXPECT_NE(cycle.winner, ENGRAM_CANDIDATE_KNN);
    }
  }
  EXPECT_EQ(cycle.rung, ENGRAM_RUNG_PLAN);
  EXPECT_EQ(cycle.nguess, 5);
}

}  // namespace
}  // namespace engram::test
