// options: -Og
// Contacts that cannot hold end as a status, never as a number that is none. Those that can: the same bits by any number of threads.
#include "bench/thread_pool.h"
#include "controller/fddp/fddp_solve.h"
#include "controller/ocp/ocp_contact.h"
#include "controller/ocp/ocp_frame.h"
#include "controller/ocp/ocp_regularization.h"
#include "tables/anymal/robot.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <memory>

namespace engram {
namespace {

using R = robots::Anymal;

// The left fore foot twice, and the right hind foot.
struct Feet {
  using Robot = R;
  static constexpr int n = 3;
  static constexpr int frame[n] = {R::kLfFoot, R::kLfFoot, R::kRhFoot};
  static constexpr ContactKind kind[n] = {ContactKind::kPoint, ContactKind::kPoint, ContactKind::kPoint};
  static constexpr double kp = 0.0, kd = 10.0;
};
using Foot = FrameTranslationTerm<R, R::kRfFoot>;
using P = ContactOcp<Feet, StateTerm<R>, ControlTerm<R, false>, Foot>;
constexpr int N = 8;

struct Case {
  Horizon<P, N> h = {};
  FddpWork<P, N> w;
  FddpSolution<P, N> s = {};
  FddpStats stats;
  explicit Case(unsigned contacts) {
    h.n = N;
    for (int i = 0; i < P::nq; ++i) h.x0[i] = R::q_home[i];
    for (int k = 0; k <= N; ++k) {
      h.phase[k] = contacts;
      auto& knot = h.knot[k];
      knot.dt = k < N ? 0.02 : 0.0;
      for (int i = 0; i < P::ndx; ++i) knot.state_w[i] = 1.0;
      for (int i = 0; i < P::nx; ++i) knot.state_ref[i] = s.x[k][i] = h.x0[i];
      knot.control_w = k < N ? 1e-3 : 0.0;
    }
  }
  FddpStatus solve() { return fddp_solve(h, FddpOpts{}, w, s, stats); }
  bool finite() const {
    double sum = s.cost;
    for (int k = 0; k <= N; ++k) {
      for (double x : s.x[k]) sum += x;
      for (int i = 0; k < N && i < P::nu; ++i) sum += s.u[k][i];
    }
    return std::isfinite(sum);
  }
};

TEST(FddpBadContacts, TheSameFootTwiceIsAStatus) {
  auto c = std::make_unique<Case>(3u);
  EXPECT_EQ(c->solve(), FddpStatus::kNotFinite);
  for (int k = 0; k <= N; ++k)
    for (int i = 0; i < P::nx; ++i) EXPECT_EQ(c->s.x[k][i], c->h.x0[i]);  // the guess is unchanged
  EXPECT_EQ(std::make_unique<Case>(1u)->solve(), FddpStatus::kConverged);
  EXPECT_EQ(std::make_unique<Case>(5u)->solve(), FddpStatus::kConverged);
}

TEST(FddpBadContacts, AnImpactOfTheSameFootTwiceIsAStatus) {
  auto c = std::make_unique<Case>(1u);
  c->h.phase[4] = kImpact | 3u;
  c->h.knot[4].dt = 0.0;
  EXPECT_EQ(c->solve(), FddpStatus::kNotFinite);
}

// A place that no leg reaches: the solver ends, with numbers, at what is nearest.
TEST(FddpBadContacts, AnUnreachableFootholdIsLeftOpen) {
  auto c = std::make_unique<Case>(5u);
  for (int k = 0; k <= N; ++k) {
    auto& p = static_cast<Foot::Param<double>&>(c->h.knot[k]);
    p.translation_w = 1e3;
    p.translation_p[0] = 50.0;
  }
  const FddpStatus status = c->solve();
  EXPECT_TRUE(status == FddpStatus::kConverged || status == FddpStatus::kIterationLimit || status == FddpStatus::kNotPositiveDefinite);
  EXPECT_TRUE(c->finite());
}

TEST(FddpBadContacts, NoNumberIsAStatus) {
  for (int place = 0; place < 3; ++place) {
    auto c = std::make_unique<Case>(5u);
    (place == 0 ? c->h.x0[3] : place == 1 ? c->h.knot[2].state_ref[9] : c->s.u[1][0]) = NAN;
    EXPECT_EQ(c->solve(), FddpStatus::kNotFinite);
  }
}

// Stance on two feet, a touch-down, stance on one: every byte of model, gaps, cost and solution.
TEST(FddpContacts, ThreadsGiveTheSameBits) {
  const auto start = [] {
    auto c = std::make_unique<Case>(5u);
    for (int k = 0; k < N; ++k) {
      for (int i = 0; i < P::nu; ++i) c->s.u[k][i] = std::sin(1.0 + 2.3 * i + k);
      if (k > 4) c->h.phase[k] = 1u;
    }
    c->h.phase[4] = kImpact | 5u;
    c->h.knot[4].dt = 0.0;
    std::memset(static_cast<void*>(&c->w), 0, sizeof(c->w));
    fddp_start(FddpOpts{}, c->w, c->stats);
    return c;
  };
  const auto one = start();
  ASSERT_TRUE(fddp_linearize(one->h, one->s, one->w));
  FddpOpts opts;
  opts.iterations = 10;
  const auto one_solved = start();
  ASSERT_EQ(fddp_solve(one_solved->h, opts, one_solved->w, one_solved->s, one_solved->stats), FddpStatus::kIterationLimit);
  EXPECT_GT(one_solved->stats.last().step_length, 0.0);  // it moves
  for (int threads : {2, 3}) {
    bench::ThreadPool pool(threads);
    const auto scratch = std::make_unique<P::Lanes[]>(threads - 1);
    const auto more = start(), solved = start();
    more->w.more_lanes = solved->w.more_lanes = scratch.get();
    ASSERT_TRUE(fddp_linearize(more->h, more->s, more->w, pool.threads()));
    EXPECT_EQ(std::memcmp(more->w.model, one->w.model, sizeof(one->w.model)), 0) << threads;
    EXPECT_EQ(std::memcmp(more->w.f, one->w.f, sizeof(one->w.f)), 0) << threads;
    EXPECT_EQ(std::memcmp(&more->w.cost, &one->w.cost, sizeof(double)), 0) << threads;
    opts.threads = pool.threads();
    ASSERT_EQ(fddp_solve(solved->h, opts, solved->w, solved->s, solved->stats), FddpStatus::kIterationLimit);
    EXPECT_EQ(std::memcmp(&solved->s, &one_solved->s, sizeof(solved->s)), 0) << threads;
  }
}

}  // namespace
}  // namespace engram
