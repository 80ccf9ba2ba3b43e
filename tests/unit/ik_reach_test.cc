// Inverse kinematics: reaches, keeps limits, prefers a posture without giving up the pose, leaves a free base alone, says when it fails.
#include <gtest/gtest.h>

#include "controller/ik/ik_reach.h"
#include "tests/unit/rbd_test_robots.h"

namespace engram::test {
namespace {

constexpr double kReached = 1e-8;  // quadratic convergence ends far below any use

template <class R> struct Problem {
  Mat3<double> R_WT;
  Vec3<double> p_WT;
  Vec<double, R::nq> q;  // one solution

  // the pose of a frame at a random posture well inside the limits
  Problem(int frame, Random& random) {
    for (int i = 0; i < R::nq; ++i) q[i] = R::q_home[i];
    const int shift = R::nq - R::nv;
    for (int k = has_free_base<R>() ? 6 : 0; k < R::nv; ++k) {
      const double lo = R::q_lo[k + shift], hi = R::q_hi[k + shift];
      q[k + shift] = 0.5 * (lo + hi) + 0.4 * (hi - lo) * random();
    }
    RbdData<R, double> d;
    rbd_kinematics<R>(q.data(), d);
    rbd_frame_placement<R>(d, frame, R_WT, p_WT);
  }
};

template <class R> bool within_limits(const double* q, double margin) {
  bool inside = true;
  const double rounding = 1e-15;  // of limit - margin + margin
  for (int i = has_free_base<R>() ? 7 : 0; i < R::nq; ++i) {
    inside = inside && q[i] >= R::q_lo[i] + margin - rounding && q[i] <= R::q_hi[i] - margin + rounding;
  }
  return inside;
}

// Starts within 0.4 rad of a solution, one per lane.
template <class R> int count_reached(int frame, int trials, const IkOptions& options) {
  Random random(29);
  int reached = 0;
  for (int trial = 0; trial < trials; ++trial) {
    const Problem<R> problem(frame, random);
    Pack start[R::nq], q[R::nq], residual;
    for (int i = 0; i < R::nq; ++i) start[i] = problem.q[i];
    for (int l = 0; l < kLanes; ++l) {
      for (int i = has_free_base<R>() ? 7 : 0; i < R::nq; ++i) start[i].set(l, problem.q[i] + 0.4 * random());
    }
    static RbdData<R, Pack> d;
    ik_reach<R, Pack>(frame, problem.R_WT.template cast<Pack>(), problem.p_WT.template cast<Pack>(), start, options, d, q,
                      residual);
    for (int l = 0; l < kLanes; ++l) {
      const Vec<double, R::nq> found = lane_of<R::nq>(q, l);
      EXPECT_TRUE(within_limits<R>(found.data(), options.margin));
      reached += residual[l] < kReached;
      if (residual[l] > kReached) continue;
      RbdData<R, double> check;
      Mat3<double> R_WF;
      Vec3<double> p_WF;
      rbd_kinematics<R>(found.data(), check);
      rbd_frame_placement<R>(check, frame, R_WF, p_WF);
      EXPECT_LT((p_WF - problem.p_WT).norm(), kReached);
      EXPECT_LT((R_WF - problem.R_WT).norm(), 2 * kReached);
    }
  }
  return reached;
}

TEST(IkReach, PandaFromNearbyStarts) {
  EXPECT_GE(count_reached<robots::Panda>(robots::Panda::kHandTcp, 250, {}), 0.98 * 250 * kLanes);  // measured: 0.995
}

TEST(IkReach, TalosArmsAndFeetWithTheBaseAtRest) {
  using R = robots::Talos;
  for (int frame = 0; frame < R::nframe; ++frame) {
    if (R::frame_joint[frame] == 0) continue;
    EXPECT_GE(count_reached<R>(frame, 25, {}), 0.9 * 25 * kLanes) << R::frame_name[frame];
  }
}

// The arm has one dof to spare: with a posture it ends nearer to it, at the same pose.
TEST(IkReach, PostureInTheNullSpace) {
  using R = robots::Panda;
  Random random(31);
  RbdData<R, double> d;
  int nearer = 0;
  const int trials = 50;
  for (int trial = 0; trial < trials; ++trial) {
    const Problem<R> problem(R::kHandTcp, random);
    double start[R::nq], q[2][R::nq], residual[2], distance[2] = {};
    for (int i = 0; i < R::nq; ++i) start[i] = problem.q[i] + 0.3 * random();
    IkOptions options;
    for (int with = 0; with < 2; ++with) {
      options.posture = with ? R::q_home : nullptr;
      options.tolerance = 1e-3;
      options.iterations = 60;
      ik_reach<R>(R::kHandTcp, problem.R_WT, problem.p_WT, start, options, d, q[with], residual[with]);
      for (int i = 0; i < R::nq; ++i) distance[with] += (q[with][i] - R::q_home[i]) * (q[with][i] - R::q_home[i]);
    }
    nearer += residual[1] < 1e-3 && distance[1] <= distance[0];
  }
  EXPECT_GE(nearer, 0.9 * trials);
}

TEST(IkReach, OutOfReachEndsNearby) {
  using R = robots::Panda;
  RbdData<R, double> d;
  double q[R::nq], residual;
  const Mat3<double> turned = Mat3<double>::Identity();
  ik_reach<R, double>(R::kHandTcp, turned, {3.0, 0.0, 0.5}, R::q_home, {}, d, q, residual);
  EXPECT_GT(residual, 1.0);  // the arm is 0.9 m long
  EXPECT_LT(residual, 3.0);
  EXPECT_TRUE(within_limits<R>(q, 0.0));
}

TEST(IkReach, PoseThatIsNotFiniteGivesAnInfiniteResidualAndTheStart) {
  using R = robots::Panda;
  RbdData<R, double> d;
  double q[R::nq], residual;
  ik_reach<R, double>(R::kHandTcp, Mat3<double>::Identity(), {0.5, std::nan(""), 0.5}, R::q_home, {}, d, q, residual);
  EXPECT_TRUE(std::isinf(residual));
  for (int i = 0; i < R::nq; ++i) EXPECT_EQ(q[i], R::q_home[i]);
}

TEST(IkReach, LanesEqualTheScalarBitForBit) {
  using R = robots::Panda;
  Random random(37);
  const Problem<R> problem(R::kHandTcp, random);
  Pack start[R::nq], q[R::nq], residual;
  for (int i = 0; i < R::nq; ++i) {
    for (int l = 0; l < kLanes; ++l) start[i].set(l, problem.q[i] + random());
  }
  IkOptions options;
  options.posture = R::q_home;
  RbdData<R, Pack> d;
  ik_reach<R, Pack>(R::kHandTcp, problem.R_WT.cast<Pack>(), problem.p_WT.cast<Pack>(), start, options, d, q, residual);
  for (int l = 0; l < kLanes; ++l) {
    RbdData<R, double> d1;
    double q1[R::nq], residual1;
    ik_reach<R>(R::kHandTcp, problem.R_WT, problem.p_WT, lane_of<R::nq>(start, l).data(), options, d1, q1, residual1);
    EXPECT_EQ(residual1, residual[l]);
    for (int i = 0; i < R::nq; ++i) EXPECT_EQ(q1[i], q[i][l]);
  }
}

}  // namespace
}  // namespace engram::test
