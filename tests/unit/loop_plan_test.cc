// Knot times, the state on a plan, and resampling it.
#include "controller/loop/loop_plan.h"

#include <gtest/gtest.h>

#include "controller/ocp/ocp_reach.h"
#include "tables/panda_reach/task.h"

namespace engram::test {
namespace {

using P = Reach<tasks::PandaReach>;
constexpr int N = 5, nq = P::nq;
constexpr int64_t kStep = 30000;

// A motion: accelerations a_k, integrated as the problem does.
Plan<P, N> motion() {
  Plan<P, N> plan;
  plan.n = N;
  knot_times<N>(7000, 0, kStep, plan.utime);
  for (int i = 0; i < nq; ++i) plan.s.x[0][i] = robots::Panda::q_home[i], plan.s.x[0][nq + i] = 0.1 * i;
  for (int k = 0; k < N; ++k) {
    for (int i = 0; i < nq; ++i) {
      const double v = plan.s.x[k][nq + i] + plan.dt(k) * (k - 2.0 + 0.3 * i);
      plan.s.x[k + 1][nq + i] = v;
      plan.s.x[k + 1][i] = plan.s.x[k][i] + plan.dt(k) * v;
      plan.s.u[k][i] = 10.0 * k + i;
    }
  }
  return plan;
}

TEST(LoopPlan, FirstKnotShrinksAndIsDroppedAtTheGridPoint) {
  int64_t t[N + 1];
  knot_times<N>(100000, 100000, kStep, t);
  EXPECT_EQ(t[1], 130000);
  knot_times<N>(120000, 130000, kStep, t);
  EXPECT_EQ(t[0], 120000);
  EXPECT_EQ(t[1], 130000);  // ends where it ended
  EXPECT_EQ(t[N], 130000 + (N - 1) * kStep);
  knot_times<N>(130000, 130000, kStep, t);
  EXPECT_EQ(t[1], 160000);  // dropped, and one appended
  EXPECT_EQ(t[N], 130000 + N * kStep);
  knot_times<N>(95000, 130000, kStep, t);  // a phase in the future counts backwards
  EXPECT_EQ(t[1], 100000);
}

TEST(LoopPlan, StateMovesWithConstantAccelerationWithinAKnot) {
  const Plan<P, N> plan = motion();
  double x[P::nx], later[P::nx];
  for (int k = 0; k < N; ++k) {
    plan_state(plan, plan.utime[k], x);
    for (int i = 0; i < P::nx; ++i) EXPECT_EQ(x[i], plan.s.x[k][i]);  // exact at the knots
    const int64_t half = (plan.utime[k] + plan.utime[k + 1]) / 2;
    plan_state(plan, half, x);
    plan_state(plan, half + 1000, later);
    for (int i = 0; i < nq; ++i) {
      const double a = (plan.s.x[k + 1][nq + i] - plan.s.x[k][nq + i]) / plan.dt(k);
      EXPECT_NEAR(later[i] - x[i], 1e-3 * x[nq + i] + 0.5e-6 * a, 1e-14);  // rounding
      EXPECT_NEAR(later[nq + i] - x[nq + i], 1e-3 * a, 1e-14);
    }
  }
}

TEST(LoopPlan, RestsBeyondItsEndAndStartsAtItsFirstState) {
  const Plan<P, N> plan = motion();
  double x[P::nx];
  plan_state(plan, plan.utime[N] + 50000, x);
  for (int i = 0; i < nq; ++i) {
    EXPECT_EQ(x[i], plan.s.x[N][i]);
    EXPECT_EQ(x[nq + i], 0.0);
  }
  plan_state(plan, plan.utime[0] - 5000, x);
  for (int i = 0; i < P::nx; ++i) EXPECT_EQ(x[i], plan.s.x[0][i]);
}

TEST(LoopPlan, ResampledOnItsOwnTimesItIsItself) {
  const Plan<P, N> plan = motion();
  Seed<P, N> seed;
  resample(plan, plan.utime, plan.s.x[0], seed);
  for (int k = 0; k < N; ++k) {
    for (int i = 0; i < P::nx; ++i) EXPECT_EQ(seed.x[k][i], plan.s.x[k][i]);
    for (int i = 0; i < P::nu; ++i) EXPECT_EQ(seed.u[k][i], plan.s.u[k][i]);
  }
}

TEST(LoopPlan, ResampledLaterItDropsTheFrontAndComesToRest) {
  const Plan<P, N> plan = motion();
  int64_t t[N + 1];
  knot_times<N>(plan.utime[1], plan.utime[1], kStep, t);
  Seed<P, N> seed;
  resample(plan, t, plan.s.x[1], seed);
  for (int k = 0; k + 1 < N; ++k) {
    for (int i = 0; i < P::nu; ++i) EXPECT_EQ(seed.u[k][i], plan.s.u[k + 1][i]);
  }
  for (int i = 0; i < P::nx; ++i) EXPECT_EQ(seed.x[N - 1][i], plan.s.x[N][i]);
  // the appended knot is a motion of the robot, half as fast
  P::Knot<double> knot = {};
  knot.dt = 0.03;
  double x[P::nx], cost;
  P::calc<double>(knot, seed.x[N - 1], seed.u[N - 1], x, cost);
  for (int i = 0; i < P::nx; ++i) EXPECT_NEAR(x[i], seed.x[N][i], 1e-11);  // inverse and forward dynamics: rounding
  for (int i = 0; i < nq; ++i) EXPECT_DOUBLE_EQ(seed.x[N][nq + i], 0.5 * seed.x[N - 1][nq + i]);
}

TEST(LoopPlan, StandingStillIsAnEquilibrium) {
  double x0[P::nx] = {}, x[P::nx], cost;
  std::memcpy(x0, robots::Panda::q_home, sizeof robots::Panda::q_home);
  Seed<P, N> seed;
  stand_still<P, N>(x0, seed);
  P::Knot<double> knot = {};
  knot.dt = 0.03;
  P::calc<double>(knot, seed.x[2], seed.u[2], x, cost);
  for (int i = 0; i < P::nx; ++i) EXPECT_NEAR(x[i], x0[i], 1e-12);  // rounding of torques of up to 50 N m
}

}  // namespace
}  // namespace engram::test
