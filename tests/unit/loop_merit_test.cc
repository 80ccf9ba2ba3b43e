// The merit of guesses: cost + weight * L1 gaps, as the scalar code computes it, whatever lane a guess lies in.
#include "controller/loop/loop_merit.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "controller/loop/loop_plan.h"
#include "controller/ocp/ocp_reach.h"
#include "tables/panda_reach/task.h"

namespace engram::test {
namespace {

using Task = tasks::PandaReach;
using P = Reach<Task>;
constexpr int N = 6, kCount = 7;  // more than one pack, and not a multiple of it

struct MeritTest : testing::Test {
  Horizon<P, N> h;
  Seed<P, N> seed[kCount];
  Candidate<P> candidates[kCount];

  MeritTest() {
    ReachTarget target;
    const double task[7] = {0.3, 0.1, 0.5, 1, 0, 0, 0};
    reach_target(task, target);
    h.n = N;
    for (int k = 0; k <= N; ++k) reach_knot<Task>(target, k < N ? 0.03 : 0.0, 0.03 * k, h.knot[k]);
    std::mt19937_64 random(3);
    std::uniform_real_distribution<double> noise(-0.1, 0.1);
    for (int i = 0; i < P::nq; ++i) h.x0[i] = robots::Panda::q_home[i], h.x0[P::nq + i] = noise(random);
    for (int c = 0; c < kCount; ++c) {
      stand_still<P, N>(h.x0, seed[c]);
      for (auto& x : seed[c].x)
        for (double& value : x) value += noise(random);
      candidates[c] = {ENGRAM_CANDIDATE_COLD, seed[c].x, seed[c].u, 0.0, 0.0, 0.0};
    }
  }
  double merit(const Seed<P, N>& s) const {
    double cost, sum = 0, x_next[P::nx], f[P::Layout::nxp];
    std::memcpy(x_next, h.x0, sizeof x_next);
    for (int k = 0; k <= N; ++k) {
      P::difference(s.x[k], x_next, f);
      for (double e : f) sum += kMeritWeight * std::fabs(e);
      if (k < N) P::calc<double>(h.knot[k], s.x[k], s.u[k], x_next, cost);
      else P::calc_terminal<double>(h.knot[k], s.x[k], cost);
      sum += cost;
    }
    return sum;
  }
};

TEST_F(MeritTest, EqualsTheScalarSum) {
  loop_merit(h, candidates, kCount);
  for (int c = 0; c < kCount; ++c) EXPECT_NEAR(candidates[c].merit, merit(seed[c]), 1e-9 * merit(seed[c]));  // order of summation
}

TEST_F(MeritTest, DoesNotDependOnTheNeighbours) {
  loop_merit(h, candidates, kCount);
  for (int c = 0; c < kCount; ++c) {
    Candidate<P> alone = candidates[c];
    loop_merit(h, &alone, 1);
    EXPECT_EQ(alone.merit, candidates[c].merit);  // to the bit: lanes never mix
  }
}

TEST_F(MeritTest, AGuessThatIsNotFiniteIsInfinitelyBad) {
  seed[2].x[3][1] = NAN;
  seed[5].u[0][0] = INFINITY;
  loop_merit(h, candidates, kCount);
  for (int c = 0; c < kCount; ++c) EXPECT_EQ(std::isinf(candidates[c].merit), c == 2 || c == 5);
}

}  // namespace
}  // namespace engram::test
