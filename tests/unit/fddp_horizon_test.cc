// Horizons of any length up to the maximum, those that are refused, and linearization by several threads: the same bits.
#include "bench/problems.h"
#include "bench/thread_pool.h"
#include "controller/fddp/fddp_solve.h"

#include <gtest/gtest.h>

#include <cstring>
#include <memory>

namespace engram {
namespace {

using bench::Arm;
constexpr int N = 23;

struct Case {
  Horizon<Arm, N> h;
  FddpWork<Arm, N> w;
  FddpSolution<Arm, N> s;
  FddpStats stats;
  FddpOpts opts;
  explicit Case(int T = N) {
    bench::arm_horizon(T, robots::Panda::q_home, h);
    bench::arm_cold_start(h, s);
  }
  FddpStatus solve() { return fddp_solve(h, opts, w, s, stats); }
  FddpStatus prepare() { return fddp_prepare(h, opts, w, s, stats); }
};

// The same solver object serves every length, in any order; what is beyond the horizon is not looked at.
TEST(FddpHorizon, AnyLengthUpToTheMaximum) {
  auto reused = std::make_unique<Case>();
  for (int T : {N, 1, 5, N - 1, 2}) {
    auto fresh = std::make_unique<Case>(T);
    ASSERT_EQ(fresh->solve(), FddpStatus::kConverged) << T;
    bench::arm_horizon(T, robots::Panda::q_home, reused->h);
    bench::arm_cold_start(reused->h, reused->s);
    for (int k = T + 1; k <= N; ++k) reused->h.knot[k].dt = reused->s.x[k][0] = std::nan("");
    ASSERT_EQ(reused->solve(), FddpStatus::kConverged) << T;
    EXPECT_EQ(reused->s.cost, fresh->s.cost) << T;
    EXPECT_EQ(std::memcmp(reused->s.u, fresh->s.u, T * sizeof(fresh->s.u[0])), 0) << T;
  }
}

TEST(FddpHorizon, OneThatIsTooLongIsRefused) {
  for (int T : {N + 1, 1 << 30, -1}) {
    auto c = std::make_unique<Case>();
    c->h.n = T;
    EXPECT_EQ(c->solve(), FddpStatus::kBadHorizon);
    EXPECT_EQ(c->stats.iterations, 0);
    EXPECT_EQ(c->prepare(), FddpStatus::kBadHorizon);
    EXPECT_EQ(c->stats.status, FddpStatus::kBadHorizon);
  }
  auto c = std::make_unique<Case>();
  c->h.n = N + 1;
  EXPECT_NE(std::strstr(fddp_check(c->h).text, "longer than the compile-time maximum; shorten it"), nullptr);
}

TEST(FddpHorizon, APhaseOfNoLengthIsRefused) {
  for (double dt : {0.0, -0.01, std::nan("")}) {
    auto c = std::make_unique<Case>();
    c->h.knot[7].dt = dt;
    EXPECT_EQ(c->solve(), FddpStatus::kBadHorizon);
    const auto before = std::make_unique<FddpSolution<Arm, N>>(c->s);
    EXPECT_EQ(c->prepare(), FddpStatus::kBadHorizon);
    EXPECT_EQ(std::memcmp(&c->s, before.get(), sizeof(c->s)), 0);  // the solution is unchanged
    const FddpHorizonError error = fddp_check(c->h);
    EXPECT_EQ(error.knot, 7);
    EXPECT_NE(std::strstr(error.text, "a phase of no length; give the knot dt > 0"), nullptr);
  }
  auto whole = std::make_unique<Case>();
  EXPECT_EQ(fddp_check(whole->h).text, nullptr);
  EXPECT_EQ(whole->prepare(), FddpStatus::kIterationLimit);
}

TEST(FddpHorizon, ThreadsGiveTheSameBits) {
  auto one = std::make_unique<Case>();
  ASSERT_EQ(one->solve(), FddpStatus::kConverged);
  for (int threads : {2, 3}) {
    bench::ThreadPool pool(threads);
    auto more = std::make_unique<Case>();
    const auto scratch = std::make_unique<Arm::Lanes[]>(threads - 1);
    more->w.more_lanes = scratch.get();
    more->opts.threads = pool.threads();
    ASSERT_EQ(more->solve(), FddpStatus::kConverged);
    EXPECT_EQ(more->stats.iterations, one->stats.iterations);
    EXPECT_EQ(std::memcmp(more->s.x, one->s.x, sizeof(one->s.x)), 0);
    EXPECT_EQ(std::memcmp(more->s.u, one->s.u, sizeof(one->s.u)), 0);
    for (int k = 0; k < N; ++k) {
      EXPECT_EQ(std::memcmp(more->w.model[k].D, one->w.model[k].D, sizeof(one->w.model[k].D)), 0);
      EXPECT_EQ(std::memcmp(more->w.model[k].Lz, one->w.model[k].Lz, sizeof(one->w.model[k].Lz)), 0);
    }
  }
}

}  // namespace
}  // namespace engram
