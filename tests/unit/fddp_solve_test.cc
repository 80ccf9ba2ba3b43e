// The solver: its direction against a dense KKT system, its convergence, its box, and every ending.
#include "bench/problems.h"
#include "controller/fddp/fddp_solve.h"
#include "controller/ocp/ocp_reach.h"
#include "tables/panda_reach/task.h"

#include <Eigen/Dense>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <memory>

namespace engram {
namespace {

using bench::Arm;
constexpr int N = 30;
constexpr double kHome[7] = {0, -0.785398, 0, -2.35619, 0, 1.57070, 0.785398};

struct Case {
  Horizon<Arm, N> h;
  FddpWork<Arm, N> w;
  FddpSolution<Arm, N> s;
  FddpStats stats;
  FddpOpts opts;
  explicit Case(int T = N) {
    bench::arm_horizon(T, kHome, h);
    bench::arm_cold_start(h, s);
  }
  FddpStatus solve() { return fddp_solve(h, opts, w, s, stats); }
};

// The step of one iteration is the solution of the dense KKT system of the linear-quadratic model (T knots, gaps included).
TEST(FddpSolve, DirectionSolvesTheDenseKktSystem) {
  constexpr int T = 5, nx = Arm::ndx, nu = Arm::nu, nv = Arm::nv, nz = nx + nu;
  using L = Arm::Layout;
  auto c = std::make_unique<Case>(T);
  for (int k = 0; k <= T; ++k)
    for (int i = 0; i < nx; ++i) c->s.x[k][i] += 0.1 * std::sin(1.0 + k + 3 * i);  // an infeasible trajectory
  c->opts.reg_init = 0.0;
  ASSERT_EQ(fddp_prepare(c->h, c->opts, c->w, c->s, c->stats), FddpStatus::kIterationLimit);

  // variables (dx_0, du_0, ..., dx_T), multipliers of dx_0 = f_0 and dx_{k+1} = Fx dx_k + Fu du_k + f_{k+1}
  const int n = T * nz + nx, m = (T + 1) * nx;
  Eigen::MatrixXd kkt = Eigen::MatrixXd::Zero(n + m, n + m);
  Eigen::VectorXd rhs = Eigen::VectorXd::Zero(n + m);
  for (int k = 0; k <= T; ++k) {
    const int size = k < T ? nz : nx;
    for (int i = 0; i < size; ++i) {
      rhs(k * nz + i) = -c->w.model[k].Lz[padded_index<L>(i)];
      for (int j = 0; j <= i; ++j)
        kkt(k * nz + i, k * nz + j) = kkt(k * nz + j, k * nz + i) = c->w.model[k].Lzz[padded_index<L>(i)][padded_index<L>(j)];
    }
    const int row = n + k * nx;
    for (int i = 0; i < nx; ++i) {
      kkt(row + i, k * nz + i) = 1.0;
      rhs(row + i) = c->w.f[k][padded_index<L>(i)];
      if (k > 0)
        for (int j = 0; j < nz; ++j) {
          const double D = c->w.model[k - 1].D[i % nv][padded_index<L>(j)];
          kkt(row + i, (k - 1) * nz + j) = i < nv ? -((i == j ? 1.0 : 0.0) + c->h.knot[k - 1].dt * D) : -D;
        }
    }
  }
  kkt.topRightCorner(n, m) = kkt.bottomLeftCorner(m, n).transpose();
  const Eigen::VectorXd z = kkt.fullPivLu().solve(rhs);

  // the sweep's step: dx_0 = f_0, du = -k - K dx, dx' = Fx dx + Fu du + f
  Eigen::VectorXd dx(nx);
  for (int i = 0; i < nx; ++i) dx(i) = c->w.f[0][padded_index<L>(i)];
  const double scale = z.head(n).cwiseAbs().maxCoeff();
  for (int k = 0; k <= T; ++k) {
    EXPECT_LT((dx - z.segment(k * nz, nx)).cwiseAbs().maxCoeff(), 1e-9 * scale) << "dx " << k;
    if (k == T) break;
    Eigen::VectorXd du(nu), next(nx);
    for (int i = 0; i < nu; ++i) {
      du(i) = -c->w.k[k][i];
      for (int j = 0; j < nx; ++j) du(i) -= c->s.K[k][i][padded_index<L>(j)] * dx(j);
    }
    EXPECT_LT((du - z.segment(k * nz + nx, nu)).cwiseAbs().maxCoeff(), 1e-9 * scale) << "du " << k;
    for (int i = 0; i < nv; ++i) {
      double dv = 0.0;
      for (int j = 0; j < nz; ++j) dv += c->w.model[k].D[i][padded_index<L>(j)] * (j < nx ? dx(j) : du(j - nx));
      next(nv + i) = dv + c->w.f[k + 1][L::ov + i];
      next(i) = dx(i) + c->h.knot[k].dt * dv + c->w.f[k + 1][i];
    }
    dx = next;
  }
}

// The gains are the derivative of the optimal first control: K by finite differences of fddp_feedback.
TEST(FddpSolve, GainsAreTheDerivativeOfTheControl) {
  auto c = std::make_unique<Case>();
  ASSERT_EQ(c->solve(), FddpStatus::kConverged);
  ASSERT_EQ(fddp_prepare(c->h, c->opts, c->w, c->s, c->stats), FddpStatus::kIterationLimit);
  const double h = 1e-6;
  for (int j = 0; j < Arm::nx; ++j) {
    double u[2][Arm::nu];
    for (int side = 0; side < 2; ++side) {
      auto moved = std::make_unique<Case>(*c);
      moved->h.x0[j] += side ? -h : h;
      ASSERT_TRUE(fddp_feedback(moved->h, moved->opts, moved->w, moved->s, moved->stats));
      for (int i = 0; i < Arm::nu; ++i) u[side][i] = moved->s.u[0][i];
    }
    for (int i = 0; i < Arm::nu; ++i) {
      const double slope = (u[0][i] - u[1][i]) / (2 * h), K = c->s.K[0][i][padded_index<Arm::Layout>(j)];
      EXPECT_NEAR(slope, -K, 1e-6 * (1 + std::fabs(K)));  // u = u_0 - K dx exactly; eps / h = 2e-10 relative to u
    }
  }
}

TEST(FddpSolve, ConvergesAndReportsEveryIteration) {
  auto c = std::make_unique<Case>();
  ASSERT_EQ(c->solve(), FddpStatus::kConverged);
  EXPECT_TRUE(c->stats.feasible);
  EXPECT_LE(c->stats.iterations, 15);
  EXPECT_LT(c->stats.last().stop, c->opts.stop);
  const double cost = c->s.cost;
  ASSERT_EQ(c->solve(), FddpStatus::kConverged);  // from its own solution: at once
  EXPECT_LE(c->stats.iterations, 2);
  EXPECT_NEAR(c->s.cost, cost, 1e-9 * cost);
}

// The direction found while a guess is infeasible closes all gaps in one full step.
TEST(FddpSolve, InfeasibleGuessIsClosed) {
  auto c = std::make_unique<Case>();
  ASSERT_EQ(c->solve(), FddpStatus::kConverged);
  const double best = c->s.cost;
  for (int k = 0; k <= N; ++k)
    for (int i = 0; i < Arm::nx; ++i) c->s.x[k][i] += 0.02 * std::sin(k + 2.0 * i);
  ASSERT_EQ(c->solve(), FddpStatus::kConverged);
  EXPECT_GT(c->stats.log[0].gap, 1.0);
  EXPECT_NEAR(c->s.cost, best, 1e-7 * best);
  double next[Arm::nx], cost;
  for (int k = 0; k < N; ++k) {
    Arm::calc(c->h.knot[k], c->s.x[k], c->s.u[k], next, cost);
    for (int i = 0; i < Arm::nx; ++i) EXPECT_NEAR(next[i], c->s.x[k + 1][i], 1e-12);
  }
}

using PandaReach = Reach<tasks::PandaReach>;
constexpr int NR = tasks::PandaReach::nknots;
struct ReachCase {
  Horizon<PandaReach, NR> h = {};
  FddpWork<PandaReach, NR> w;
  FddpSolution<PandaReach, NR> s;
  FddpStats stats;
  FddpOpts opts;
  ReachCase() {
    using T = tasks::PandaReach;
    ReachTarget target;
    const double task[7] = {0.45, -0.35, 0.5, 1, 0, 0, 0};
    reach_target(task, target);
    h.n = NR;
    double g[7];
    RbdData<robots::Panda, double> d;
    for (int i = 0; i < 7; ++i) h.x0[i] = robots::Panda::q_home[i];
    rbd_kinematics(h.x0, d);
    rbd_inertias(d);
    rbd_gravity(d, g);
    for (int k = 0; k <= NR; ++k) {
      reach_knot<T>(target, k < NR ? T::dt : 0.0, k * T::dt, h.knot[k]);
      for (int i = 0; i < PandaReach::nx; ++i) s.x[k][i] = h.x0[i];
      if (k < NR)
        for (int i = 0; i < 7; ++i) s.u[k][i] = g[i];
    }
  }
};

// With the box, no control leaves it, and at the end those strictly inside have a zero gradient.
TEST(FddpSolve, BoxKeepsControlsWithinTheirLimits) {
  auto c = std::make_unique<ReachCase>();
  for (int k = 0; k < NR; ++k) c->h.knot[k].limit_w_u = c->h.knot[k].limit_w_v = 0.0;  // the box alone shall hold them
  for (int k = 0; k < NR; ++k) c->h.knot[k].pose_w_p *= 100;  // in a hurry: torques saturate
  auto free = std::make_unique<ReachCase>(*c);
  c->opts.box = true;
  c->opts.iterations = free->opts.iterations = 200;
  ASSERT_EQ(fddp_solve(c->h, c->opts, c->w, c->s, c->stats), FddpStatus::kConverged);
  fddp_solve(free->h, free->opts, free->w, free->s, free->stats);
  int saturated = 0, beyond = 0;
  for (int k = 0; k < NR; ++k)
    for (int i = 0; i < 7; ++i) {
      const double limit = robots::Panda::u_max[i];
      EXPECT_LE(std::fabs(c->s.u[k][i]), limit);
      saturated += std::fabs(c->s.u[k][i]) == limit;
      beyond += std::fabs(free->s.u[k][i]) > limit;
      if (std::fabs(c->s.u[k][i]) < limit * (1 - 1e-9)) {
        EXPECT_NEAR(c->w.k[k][i], 0.0, 1e-2);  // N m: the direction vanishes off the bounds
      }
    }
  EXPECT_GT(saturated, 0);
  EXPECT_GT(beyond, 0) << "the problem does not need the box";
}

TEST(FddpSolve, BoxWithoutActiveBoundsChangesNothing) {
  auto boxed = std::make_unique<Case>(), free = std::make_unique<Case>();
  boxed->opts.box = true;
  EXPECT_EQ(boxed->solve(), free->solve());
  EXPECT_EQ(boxed->stats.iterations, free->stats.iterations);
  EXPECT_NEAR(boxed->s.cost, free->s.cost, 1e-10 * free->s.cost);
}

TEST(FddpSolve, EndsAtTheIterationLimit) {
  auto c = std::make_unique<Case>();
  c->opts.iterations = 2;
  EXPECT_EQ(c->solve(), FddpStatus::kIterationLimit);
  EXPECT_EQ(c->stats.iterations, 2);
}

TEST(FddpSolve, EndsAtTheDeadline) {
  auto c = std::make_unique<Case>();
  static double now = 0.0;
  c->opts.now_us = [] { return now += 10.0; };  // every look costs 10 us
  c->opts.budget_us = 200.0;
  EXPECT_EQ(c->solve(), FddpStatus::kDeadline);
  EXPECT_GT(c->stats.iterations, 0);
  EXPECT_LE(now, 300.0);
}

TEST(FddpSolve, RefusesWhatIsNotFinite) {
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    auto c = std::make_unique<Case>();
    c->s.u[3][2] = bad;
    EXPECT_EQ(c->solve(), FddpStatus::kNotFinite);
    auto d = std::make_unique<Case>();
    d->h.x0[1] = bad;
    EXPECT_EQ(d->solve(), FddpStatus::kNotFinite);
    auto e = std::make_unique<Case>();
    e->h.knot[7].placement_p[1] = bad;
    EXPECT_EQ(e->solve(), FddpStatus::kNotFinite);
    for (int k = 0; k <= N; ++k)
      for (double x : e->s.x[k]) EXPECT_TRUE(std::isfinite(x));  // the guess is unchanged
  }
}

TEST(FddpSolve, GivesUpOnAnIndefiniteProblem) {
  auto c = std::make_unique<Case>();
  for (int k = 0; k < N; ++k) c->h.knot[k].control_w = -1e12;
  EXPECT_EQ(c->solve(), FddpStatus::kNotPositiveDefinite);
}

TEST(FddpSolve, EmptyHorizonIsSolved) {
  auto c = std::make_unique<Case>(0);
  EXPECT_EQ(c->solve(), FddpStatus::kConverged);
}

TEST(FddpSolve, SameInputSameBits) {
  auto a = std::make_unique<Case>(), b = std::make_unique<Case>();
  a->solve();
  b->solve();
  for (int k = 0; k <= N; ++k)
    for (int i = 0; i < Arm::nx; ++i) EXPECT_EQ(a->s.x[k][i], b->s.x[k][i]);
}

}  // namespace
}  // namespace engram
