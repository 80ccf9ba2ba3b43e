// Constraints by augmented Lagrangian on a mass that is pushed along a line, where the optimum is known; and on one that is pushed off a
// foot that must not slip.
#include "controller/fddp/fddp_lagrangian.h"
#include "controller/ocp/ocp.h"
#include "controller/ocp/ocp_contact.h"
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

// A foot of 1 kg that can go anywhere (x, y, z), and on it a mass of 1 kg that is pushed along x.
struct Skater {
  static constexpr int nj = 4, nq = 4, nv = 4, nu = 1;
  static constexpr JointKind kind[nj] = {kPrismatic, kPrismatic, kPrismatic, kPrismatic};
  static constexpr int parent[nj] = {-1, 0, 1, 2}, iq[nj] = {0, 1, 2, 3}, iv[nj] = {0, 1, 2, 3}, nsub[nj] = {4, 3, 2, 1};
  static constexpr double R_PJ[nj][9] = {{0, 0, 1, 1, 0, 0, 0, 1, 0}, {0, 0, 1, 1, 0, 0, 0, 1, 0}, {0, 0, 1, 1, 0, 0, 0, 1, 0}, {0, 0, 1, 1, 0, 0, 0, 1, 0}};
  static constexpr double p_PJ[nj][3] = {}, mass[nj] = {0, 0, 1, 1}, com[nj][3] = {}, inertia[nj][6] = {};
  static constexpr double armature[nv] = {}, gravity[3] = {0, 0, -9.81}, u_max[nu] = {1e8};
  enum Frame { kFoot, nframe };
  static constexpr int frame_joint[nframe] = {2};
  static constexpr double R_JF[nframe][9] = {{1, 0, 0, 0, 1, 0, 0, 0, 1}}, p_JF[nframe][3] = {};
};
struct Foot {
  using Robot = Skater;
  static constexpr int n = 1, frame[n] = {Skater::kFoot};
  static constexpr ContactKind kind[n] = {ContactKind::kPoint};
  static constexpr double kp = 0.0, kd = 0.0;
};
using End = ResidualTerm<State<Skater>, Lagrangian>;
using Barrier = FrictionConeTerm<0>;
using Grip = ConeLimit<FrictionConeTerm<0>>;
using Skating = ContactOcp<Foot, ControlTerm<Skater, false>, End, Barrier, Grip>;

// The mass goes 1 m in 1 s from rest to rest; what pushes it off, friction of at most `most` bears.
struct SkaterCase {
  static constexpr double most = 4.5, mu = most / (2.0 * 9.81);  // N; the free optimum needs 5.7
  Horizon<Skating, N> h = {};
  FddpWork<Skating, N> w;
  FddpSolution<Skating, N> s = {};
  FddpStats inner;
  LagrangianStats stats;
  LagrangianOpts outer;
  explicit SkaterCase(bool hard) {
    outer.tolerance = 1e-8;
    h.n = N;
    for (int k = 0; k < N; ++k) {
      h.knot[k].dt = kDt;
      h.knot[k].control_w = kWeight;
      h.phase[k] = 1u;
      h.knot[k].friction_mu = mu;
      h.knot[k].friction_w = hard ? 0.0 : 0.1;
      auto& grip = param_of<Grip>(h.knot[k]);
      grip.cone.friction_mu = mu;
      for (int i = 0; i < Grip::kFaces; ++i) {
        grip.w[i] = hard ? 0.1 : 0.0;
        grip.lo[i] = -1e8;
      }
    }
    auto& end = param_of<End>(h.knot[N]);
    end.w[3] = end.w[7] = 1.0;
    end.lo[3] = end.hi[3] = 1.0;
  }
  FddpStatus solve() { return fddp_lagrangian(h, outer, FddpOpts{}, w, s, inner, stats); }
};

// Friction is the push: minimize 1/2 kWeight |u|^2 subject to A u = b, |u| <= most. Its dual has two unknowns, u = clamp(A' y).
TEST(FddpLagrangian, FrictionConesAreHardAndTheirMultipliersTheDuals) {
  auto c = std::make_unique<SkaterCase>(true);
  ASSERT_EQ(c->solve(), FddpStatus::kConverged);
  EXPECT_LT(c->stats.violation, 1e-8);
  Eigen::Matrix<double, 2, N> A;
  for (int j = 0; j < N; ++j) A.col(j) << kDt * kDt * (N - j), kDt;
  const Eigen::Vector2d b(1.0, 0.0);
  const auto clamped = [&](const Eigen::Vector2d& y) -> Eigen::VectorXd {
    return (A.transpose() * y).cwiseMin(SkaterCase::most).cwiseMax(-SkaterCase::most);
  };
  Eigen::Vector2d y = (A * A.transpose()).ldlt().solve(b);
  for (int i = 0; i < 50; ++i) {  // Newton on A clamp(A' y) = b
    Eigen::Matrix2d slope = 1e-12 * Eigen::Matrix2d::Identity();
    for (int j = 0; j < N; ++j)
      if (std::fabs(A.col(j).dot(y)) < SkaterCase::most) slope += A.col(j) * A.col(j).transpose();
    y += slope.ldlt().solve(b - A * clamped(y));
  }
  const Eigen::VectorXd u = clamped(y);
  ASSERT_LT((A * u - b).norm(), 1e-10);
  int tight = 0;
  for (int j = 0; j < N; ++j) {
    EXPECT_NEAR(c->s.u[j][0], u[j], 1e-5);
    const auto& grip = param_of<Grip>(c->h.knot[j]);
    const double beyond = A.col(j).dot(y) - u[j];  // what the cone takes away
    // faces +x, -x, +y, -y, -z; u pushes the foot along -x, which the ground answers along +x
    EXPECT_NEAR(grip.lambda[0] - grip.lambda[1], kWeight * beyond, 1e-6);
    EXPECT_GE(std::fmin(grip.lambda[0], grip.lambda[1]), 0.0);
    for (int i = 2; i < Grip::kFaces; ++i) EXPECT_EQ(grip.lambda[i], 0.0);
    tight += std::fabs(beyond) > 1e-6;
  }
  EXPECT_GT(tight, 2);
  EXPECT_LT(tight, N - 2);
}

template <class Cone> int faces() {
  int n = 0;
  Cone::visit(typename Cone::template Param<double>{}, [&](const auto&) { ++n; });
  return n;
}
TEST(FddpLagrangian, EveryFaceOfAConeHasItsMultiplier) {
  EXPECT_EQ(faces<FrictionConeTerm<0>>(), FrictionConeTerm<0>::kFaces);
  EXPECT_EQ(faces<WrenchConeTerm<0>>(), WrenchConeTerm<0>::kFaces);
  EXPECT_EQ(faces<CopTerm<0>>(), CopTerm<0>::kFaces);
}

TEST(FddpLagrangian, ABarrierOfTheSameConeGivesWay) {
  auto c = std::make_unique<SkaterCase>(false);
  ASSERT_EQ(c->solve(), FddpStatus::kConverged);
  double most = 0.0;
  for (int j = 0; j < N; ++j) most = std::fmax(most, std::fabs(c->s.u[j][0]));
  EXPECT_GT(most, SkaterCase::most + 0.01);
  EXPECT_LT(most, 5.7);
}

}  // namespace
}  // namespace engram
