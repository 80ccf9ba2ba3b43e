// Inverse kinematics of a pose: converges from nearby starts, keeps the limits, survives what cannot be reached.
#include "controller/ik/ik_pose.h"

#include "controller/ocp/ocp_reach.h"
#include "tables/panda_reach/task.h"

#include <gtest/gtest.h>

#include <random>

namespace engram {
namespace {

using Task = tasks::PandaReach;
using R = Task::Robot;
constexpr int nq = R::nq;

ReachTarget pose_of(const double* q) {
  Mat3<double> R_WH;
  Vec3<double> p_WH;
  reach_hand<Task>(q, R_WH, p_WH);
  ReachTarget target;
  for (int i = 0; i < 3; ++i) target.p[i] = p_WH[i];
  for (int i = 0; i < 9; ++i) target.R[i] = R_WH(i / 3, i % 3);
  return target;
}

struct Draw {
  std::mt19937 random{7};
  double uniform(double lo, double hi) { return std::uniform_real_distribution<double>(lo, hi)(random); }
  void posture(double* q) {
    for (int i = 0; i < nq; ++i) q[i] = uniform(R::q_lo[i] + 2 * kIkMargin, R::q_hi[i] - 2 * kIkMargin);
  }
};

TEST(IkPose, ConvergesFromNearbyStarts) {
  Draw draw;
  int solved = 0;
  constexpr int kTrials = 250;
  for (int trial = 0; trial < kTrials; ++trial) {
    double q_goal[nq];
    draw.posture(q_goal);
    const ReachTarget target = pose_of(q_goal);
    Pack q[nq];
    for (int i = 0; i < nq; ++i)
      for (int l = 0; l < kLanes; ++l) q[i].l[l] = q_goal[i] + draw.uniform(-0.4, 0.4);
    RbdData<R, Pack> d;
    const Pack error = ik_pose<R, Task::frame>(target, q, d);
    for (int l = 0; l < kLanes; ++l) {
      solved += error.l[l] < 1e-8;  // quadratic convergence ends far below any use
      double q_found[nq];
      for (int i = 0; i < nq; ++i) {
        q_found[i] = q[i].l[l];
        EXPECT_GE(q_found[i], R::q_lo[i] + kIkMargin);
        EXPECT_LE(q_found[i], R::q_hi[i] - kIkMargin);
      }
      const ReachTarget found = pose_of(q_found);  // the error it reports is the error there is
      double error2 = 0.0;
      for (int i = 0; i < 3; ++i) error2 += (found.p[i] - target.p[i]) * (found.p[i] - target.p[i]);
      EXPECT_LE(std::sqrt(error2), error.l[l] + 1e-12);
    }
  }
  EXPECT_GE(solved, 0.97 * kTrials * kLanes);  // measured: 0.995; the rest meets a limit or a singularity
}

TEST(IkPose, StaysWhereItAlreadyIs) {
  double q[nq], before[nq];
  for (int i = 0; i < nq; ++i) q[i] = before[i] = R::q_home[i];
  const ReachTarget target = pose_of(q);
  RbdData<R, double> d;
  EXPECT_LT((ik_pose<R, Task::frame>(target, q, d)), 1e-12);
  for (int i = 0; i < nq; ++i) EXPECT_NEAR(q[i], before[i], 1e-12);
}

TEST(IkPose, OutOfReachItStretchesTowardsTheTarget) {
  double q[nq];
  for (int i = 0; i < nq; ++i) q[i] = R::q_home[i];
  ReachTarget target = pose_of(q);
  target.p[0] = 3.0;  // the arm is 0.9 m long
  RbdData<R, double> d;
  const double error = ik_pose<R, Task::frame>(target, q, d);
  EXPECT_TRUE(std::isfinite(error));
  EXPECT_GT(error, 1.0);
  for (int i = 0; i < nq; ++i) {
    EXPECT_GE(q[i], R::q_lo[i] + kIkMargin);
    EXPECT_LE(q[i], R::q_hi[i] - kIkMargin);
  }
  EXPECT_GT(pose_of(q).p[0], 0.6);
}

TEST(IkPose, LanesComputeWhatOneStartDoes) {
  Draw draw;
  double q_goal[nq];
  draw.posture(q_goal);
  const ReachTarget target = pose_of(q_goal);
  Pack q[nq];
  double starts[kLanes][nq];
  for (int l = 0; l < kLanes; ++l) {
    for (int i = 0; i < nq; ++i) q[i].l[l] = starts[l][i] = q_goal[i] + draw.uniform(-0.3, 0.3);
  }
  RbdData<R, Pack> d_lanes;
  RbdData<R, double> d;
  const Pack error = ik_pose<R, Task::frame>(target, q, d_lanes);
  for (int l = 0; l < kLanes; ++l) {
    const double one = ik_pose<R, Task::frame>(target, starts[l], d);
    EXPECT_NEAR(error.l[l], one, 1e-9);
    for (int i = 0; i < nq; ++i) EXPECT_NEAR(q[i].l[l], starts[l][i], 1e-7);  // rounding, fused or not, along 24 steps
  }
}

}  // namespace
}  // namespace engram
