// link: engram_offline
// options: -Og
// An arm under equalities and inequalities: the augmented Lagrangian's optimum against Ipopt's.
#include "bench/problems.h"
#include "codegen/offline/ipopt_shooting.h"
#include "controller/fddp/fddp_lagrangian.h"
#include "controller/ocp/ocp_motion_residuals.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>

namespace engram {
namespace {

using R = robots::Panda;
constexpr int N = 30, kLockedJoint = 2;
constexpr double kLeastHeight = 0.45, kSpeed = 2.5;  // m, rad/s; without constraints the hand ends at 0.4 m, and joints turn faster
constexpr double kFree = 1e8;

using Hold = ResidualTerm<State<R>, Lagrangian>;
using Height = ResidualTerm<FrameTranslation<R, R::kHandTcp>, Lagrangian>;
using Arm = Ocp<R, FramePlacementTerm<R, R::kHandTcp>, StateTerm<R>, ControlTerm<R, false>, Hold, Height>;

// The arm of bench/problems.h; with penalty > 0 also: hand above a height, joint speeds bounded, one joint locked.
void make(double penalty, Horizon<Arm, N>& h, FddpSolution<Arm, N>& s) {
  static Horizon<bench::Arm, N> plain;
  static FddpSolution<bench::Arm, N> start;
  bench::arm_horizon(N, R::q_home, plain);
  bench::arm_cold_start(plain, start);
  h = {};
  h.n = N;
  std::copy_n(plain.x0, Arm::nx, h.x0);
  for (int k = 0; k <= N; ++k) {
    auto& knot = h.knot[k];
    param_of<FramePlacementTerm<R, R::kHandTcp>>(knot) = param_of<FramePlacementTerm<R, R::kHandTcp>>(plain.knot[k]);
    param_of<StateTerm<R>>(knot) = param_of<StateTerm<R>>(plain.knot[k]);
    param_of<ControlTerm<R, false>>(knot) = param_of<ControlTerm<R, false>>(plain.knot[k]);
    knot.dt = plain.knot[k].dt;
    std::copy_n(start.x[k], Arm::nx, s.x[k]);
    if (k < N) std::copy_n(start.u[k], Arm::nu, s.u[k]);
    if (k == 0) continue;
    auto& hold = param_of<Hold>(knot);
    hold.w[kLockedJoint] = penalty;
    hold.lo[kLockedJoint] = hold.hi[kLockedJoint] = R::q_home[kLockedJoint];
    for (int i = 0; i < R::nv; ++i) {
      hold.w[R::nv + i] = penalty;
      hold.hi[R::nv + i] = kSpeed;
      hold.lo[R::nv + i] = -kSpeed;
    }
    auto& height = param_of<Height>(knot);
    height.w[2] = penalty;
    height.lo[2] = kLeastHeight;
    height.hi[2] = kFree;
  }
}

TEST(FddpLagrangianIpopt, ArmReachesTheSameConstrainedOptimum) {
  static Horizon<Arm, N> h, plain;
  static FddpWork<Arm, N> w;
  static FddpSolution<Arm, N> s, guess;
  static FddpStats inner;
  LagrangianStats stats;
  make(1.0, h, s);
  FddpOpts opts;
  LagrangianOpts outer;
  outer.tolerance = 1e-7;
  ASSERT_EQ(fddp_lagrangian(h, outer, opts, w, s, inner, stats), FddpStatus::kConverged);
  EXPECT_LT(stats.violation, 1e-7);

  // the same constraints, hard
  make(0.0, plain, guess);
  offline::StateBounds<Arm> bounds;
  for (int i = 0; i < R::nv; ++i) {
    bounds.x_lo[R::nv + i] = -kSpeed;
    bounds.x_hi[R::nv + i] = kSpeed;
  }
  bounds.x_lo[kLockedJoint] = bounds.x_hi[kLockedJoint] = R::q_home[kLockedJoint];
  offline::PathConstraint height;
  height.count = 1;
  height.evaluate = [](const double* q, double* g, double* dg) {
    RbdData<R, double> d;
    Mat3<double> R_WF;
    Vec3<double> p_WF;
    rbd_kinematics(q, d);
    rbd_frame_placement(d, R::kHandTcp, R_WF, p_WF);
    g[0] = p_WF[2] - kLeastHeight;
    for (int k = 0; k < R::nv; ++k) dg[k] = moved_to(d.J[k], p_WF).lin[2];
  };
  offline::Shooting<Arm, N> shooting(plain, bounds, height);
  offline::IpoptOptions options;
  options.iterations = 300;
  options.tolerance = 1e-7;
  const auto result = offline::ipopt_solve(shooting.program(), shooting.pack(&s.x[0][0], &s.u[0][0]), options);
  ASSERT_TRUE(result.solved) << result.status;
  EXPECT_LT(result.violation, 1e-7);

  double cost = 0.0, x_next[Arm::nx], c;
  for (int k = 0; k < N; ++k) {
    Arm::calc(plain.knot[k], s.x[k], s.u[k], x_next, c);
    cost += c;
  }
  Arm::calc_terminal(plain.knot[N], s.x[N], c);
  cost += c;
  RecordProperty("cost", std::to_string(cost));
  EXPECT_NEAR(cost, result.objective, 1e-6 * result.objective);
  int fast = 0;
  double lowest = 1.0, difference = 0.0;
  for (int k = 1; k <= N; ++k) {
    RbdData<R, double> d;
    Mat3<double> R_WF;
    Vec3<double> p_WF;
    rbd_kinematics(s.x[k], d);
    rbd_frame_placement(d, R::kHandTcp, R_WF, p_WF);
    lowest = std::fmin(lowest, p_WF[2]);
    EXPECT_NEAR(s.x[k][kLockedJoint], R::q_home[kLockedJoint], 1e-7);
    for (int i = 0; i < R::nv; ++i) fast += std::fabs(s.x[k][R::nv + i]) > kSpeed - 1e-6;
    for (int i = 0; i < Arm::nx; ++i) difference = std::fmax(difference, std::fabs(s.x[k][i] - result.z[shooting.x_at(k) + i]));
  }
  EXPECT_GT(fast, 0);
  EXPECT_NEAR(lowest, kLeastHeight, 1e-6);
  EXPECT_LT(difference, 1e-3);  // rad, rad/s: flat directions of the cost
  std::printf("rounds %d, iterations %d, violation %.1e; cost %.9f, Ipopt's %.9f in %d; states differ by %.1e\n", stats.rounds, stats.iterations,
              stats.violation, cost, result.objective, result.iterations, difference);
}

}  // namespace
}  // namespace engram
