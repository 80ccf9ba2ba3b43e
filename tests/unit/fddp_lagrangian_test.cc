// Constraints by augmented Lagrangian on a mass that is pushed along a line, where the optimum is known.
#include "controller/fddp/fddp_lagrangian.h"
#include "controller/ocp/ocp.h"
#include "controller/ocp/ocp_motion_residuals.h"
#include "controller/ocp/ocp_regularization.h"

#include <Eigen/Dense>
#include <gtest/gtest.h>

#include <cmath>
#include <memory>

namespace engram {
namespace {

struct Slider {  // 1 kg without weight
  static constexpr int nj = 1, nq = 1, nv = 1, nu = 1;
  static constexpr JointKind kind[1] = {kPrismatic};
  static constexpr int parent[1] = {-1}, iq[1] = {0}, iv[1] = {0}, nsub[1] = {1};
  static constexpr double R_PJ[1][9] = {{1, 0, 0, 0, 1, 0, 0, 0, 1}}, p_PJ[1][3] = {{0, 0, 0}};
  static constexpr double mass[1] = {1.0}, com[1][3] = {{0, 0, 0}}, inertia[1][6] = {{1, 0, 0, 1, 0, 1}};
  static constexpr double armature[1] = {0.0}, gravity[3] = {0, 0, 0}, u_max[1] = {1e8};
};

constexpr int N = 20;
constexpr double kDt = 0.05, kWeight = 0.01;
using Hold = ResidualTerm<State<Slider>, Lagrangian>;
using Problem = Ocp<Slider, ControlTerm<Slider, false>, Hold>;

struct Case {
  Horizon<Problem, N> h = {};
  FddpWork<Problem, N> w;
  FddpSolution<Problem, N> s = {};
  FddpStats inner;
  LagrangianStats stats;
  LagrangianOpts outer;
  Case() {
    h.n = N;
    for (int k = 0; k < N; ++k) {
      h.knot[k].dt = kDt;
      h.knot[k].control_w = kWeight;
    }
    outer.tolerance = 1e-8;
    constrain(N, 0, 1.0, 1.0);  // at 1 m, at rest
    constrain(N, 1, 0.0, 0.0);
  }
  void constrain(int k, int row, double lo, double hi) {
    auto& p = param_of<Hold>(h.knot[k]);
    p.w[row] = 1.0;
    p.lo[row] = lo;
    p.hi[row] = hi;
  }
  FddpStatus solve() { return fddp_lagrangian(h, outer, FddpOpts{}, w, s, inner, stats); }
};

// q_N = sum_j dt^2 (N - j) u_j and v_N = sum_j dt u_j.
void ends(const double (*u)[1], double& q, double& v) {
  q = v = 0.0;
  for (int j = 0; j < N; ++j) {
    q += kDt * kDt * (N - j) * u[j][0];
    v += kDt * u[j][0];
  }
}

TEST(FddpLagrangian, EqualitiesReachTheLeastNormSolutionAndItsMultipliers) {
  auto c = std::make_unique<Case>();
  ASSERT_EQ(c->solve(), FddpStatus::kConverged);
  EXPECT_LT(c->stats.violation, 1e-8);
  // minimize 1/2 kWeight |u|^2 subject to A u = b
  Eigen::Matrix<double, 2, N> A;
  for (int j = 0; j < N; ++j) A.col(j) << kDt * kDt * (N - j), kDt;
  const Eigen::Vector2d b(1.0, 0.0), y = (A * A.transpose()).ldlt().solve(b);
  const Eigen::VectorXd u = A.transpose() * y;
  for (int j = 0; j < N; ++j) EXPECT_NEAR(c->s.u[j][0], u[j], 1e-6 * u.cwiseAbs().maxCoeff());  // tolerance of the constraint over |A|
  for (int i = 0; i < 2; ++i) EXPECT_NEAR(param_of<Hold>(c->h.knot[N]).lambda[i], -kWeight * y[i], 1e-6 * kWeight * y.norm());
}

TEST(FddpLagrangian, InequalityIsTightWhereItPushes) {
  auto c = std::make_unique<Case>();
  for (int k = 1; k < N; ++k) c->constrain(k, 1, -1.2, 1.2);  // m/s; the free optimum needs 1.5
  ASSERT_EQ(c->solve(), FddpStatus::kConverged);
  double q, v;
  ends(c->s.u, q, v);
  EXPECT_NEAR(q, 1.0, 1e-7);
  EXPECT_NEAR(v, 0.0, 1e-7);
  int tight = 0;
  for (int k = 1; k < N; ++k) {
    const double speed = c->s.x[k][1], lambda = param_of<Hold>(c->h.knot[k]).lambda[1];
    EXPECT_LE(speed, 1.2 + 1e-7);
    EXPECT_GE(lambda, 0.0);                          // it pushes inward only
    EXPECT_NEAR(lambda * (1.2 - speed), 0.0, 1e-8);  // complementary
    tight += lambda > 1e-6;
  }
  EXPECT_GT(tight, 2);
  EXPECT_LT(tight, N - 1);
}

TEST(FddpLagrangian, MultipliersStartTheNextSolve) {
  auto c = std::make_unique<Case>();
  for (int k = 1; k < N; ++k) c->constrain(k, 1, -1.2, 1.2);
  ASSERT_EQ(c->solve(), FddpStatus::kConverged);
  const int cold = c->stats.rounds;
  c->h.x0[0] = 1e-3;
  ASSERT_EQ(c->solve(), FddpStatus::kConverged);
  EXPECT_LT(c->stats.rounds, cold);
}

TEST(FddpLagrangian, WhatCannotHoldEndsAtTheLimit) {
  auto c = std::make_unique<Case>();
  c->constrain(0, 0, 0.5, 0.5);  // the start stands at 0
  c->outer.rounds = 8;
  EXPECT_EQ(c->solve(), FddpStatus::kIterationLimit);
  EXPECT_NEAR(c->stats.violation, 0.5, 1e-12);
}

}  // namespace
}  // namespace engram
