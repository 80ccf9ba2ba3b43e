// RNEA, CRBA, ABA and forward dynamics: by hand, against each other, and against the power balance.
#include <gtest/gtest.h>

#include "controller/rbd/rbd_aba.h"
#include "controller/rbd/rbd_forward.h"
#include "controller/rbd/rbd_frames.h"
#include "controller/rbd/rbd_manifold.h"
#include "tests/unit/rbd_test_robots.h"

namespace engram::test {
namespace {

// Sums of some hundred products of numbers up to 1e3, and for ABA a division by the smallest pivot (1e-2).
constexpr double kRounding = 1e-11;

// Two point masses on massless rods that swing in the world's x-z plane: both joint axes along -y.
struct DoublePendulum {
  static constexpr int nj = 2, nq = 2, nv = 2;
  static constexpr JointKind kind[nj] = {kRevolute, kRevolute};
  static constexpr int parent[nj] = {-1, 0}, iq[nj] = {0, 1}, iv[nj] = {0, 1}, nsub[nj] = {2, 1};
  static constexpr double R_PJ[nj][9] = {{1, 0, 0, 0, 0, -1, 0, 1, 0}, {1, 0, 0, 0, 1, 0, 0, 0, 1}};
  static constexpr double p_PJ[nj][3] = {{0, 0, 0}, {0.7, 0, 0}};
  static constexpr double mass[nj] = {2, 3}, com[nj][3] = {{0.7, 0, 0}, {0.4, 0, 0}}, inertia[nj][6] = {};
  static constexpr double armature[nv] = {0, 0.5}, gravity[3] = {0, 0, -10};
};

TEST(ByHand, DoublePendulum) {
  using R = DoublePendulum;
  const double q[2] = {0.3, 1.1}, v[2] = {0.9, -0.6}, a[2] = {1.5, 2.5};
  RbdData<R, double> d;
  double tau[2];
  rbd_rnea<R>(q, v, a, d, tau);

  // angles from the x axis towards +z; l1 = 0.7, l2 = 0.4, m1 = 2, m2 = 3, g = 10
  const double c1 = std::cos(q[0]), c12 = std::cos(q[0] + q[1]), c2 = std::cos(q[1]), s2 = std::sin(q[1]);
  const double m11 = 2 * 0.49 + 3 * (0.49 + 0.16 + 2 * 0.28 * c2), m12 = 3 * (0.16 + 0.28 * c2), m22 = 3 * 0.16;
  const double coriolis = 3 * 0.28 * s2;
  const double tau1 = m11 * a[0] + m12 * a[1] - coriolis * (2 * v[0] * v[1] + v[1] * v[1]) + 10 * (5 * 0.7 * c1 + 3 * 0.4 * c12);
  const double tau2 = m12 * a[0] + (m22 + 0.5) * a[1] + coriolis * v[0] * v[0] + 10 * 3 * 0.4 * c12;
  EXPECT_NEAR(tau[0], tau1, kRounding);
  EXPECT_NEAR(tau[1], tau2, kRounding);

  Mat<double, 2, 2> M;
  rbd_crba<R>(d, M);
  EXPECT_NEAR(M(0, 0), m11, kRounding);
  EXPECT_NEAR(M(0, 1), m12, kRounding);
  EXPECT_NEAR(M(1, 0), m12, kRounding);
  EXPECT_NEAR(M(1, 1), m22 + 0.5, kRounding);
}

template <class R> class Dynamics : public ::testing::Test {
 protected:
  static constexpr int nv = R::nv;
  using VecV = Vec<double, nv>;

  Random random_{7};
  RbdData<R, double> d_;
  Vec<double, R::nq> q_ = random_.configuration<R>();
  VecV v_ = random_.vector<nv>(), a_ = random_.vector<nv>();

  VecV rnea(const VecV& v, const VecV& a) {
    VecV tau;
    rbd_rnea<R>(q_.data(), v.data(), a.data(), d_, tau.data());
    return tau;
  }
};
TYPED_TEST_SUITE(Dynamics, AllRobots);

TYPED_TEST(Dynamics, MassMatrixTimesAccelerationPlusBiasIsInverseDynamics) {
  const auto tau = this->rnea(this->v_, this->a_), bias = this->rnea(this->v_, TestFixture::VecV::Zero());
  Mat<double, TypeParam::nv, TypeParam::nv> M;
  rbd_crba<TypeParam>(this->d_, M);
  EXPECT_LT((M * this->a_ + bias - tau).cwiseAbs().maxCoeff(), kRounding);
  EXPECT_EQ((M - M.transpose()).cwiseAbs().maxCoeff(), 0.0);
}

TYPED_TEST(Dynamics, GravityIsInverseDynamicsAtRest) {
  const auto rest = TestFixture::VecV::Zero();
  const auto tau = this->rnea(rest, rest);
  typename TestFixture::VecV g;
  rbd_gravity<TypeParam>(this->d_, g.data());
  EXPECT_LT((g - tau).cwiseAbs().maxCoeff(), kRounding);
}

TYPED_TEST(Dynamics, ForwardUndoesInverse) {
  const auto tau = this->rnea(this->v_, this->a_);
  typename TestFixture::VecV by_aba, by_factor;
  rbd_aba<TypeParam>(this->q_.data(), this->v_.data(), tau.data(), this->d_, by_aba.data());
  EXPECT_LT((by_aba - this->a_).cwiseAbs().maxCoeff(), kRounding);
  rbd_forward_dynamics<TypeParam>(this->q_.data(), this->v_.data(), tau.data(), this->d_, by_factor.data());
  EXPECT_LT((by_factor - this->a_).cwiseAbs().maxCoeff(), kRounding);
}

// d/dt (kinetic + potential energy) = tau . v, along the motion itself: knows nothing of bias forces.
TYPED_TEST(Dynamics, PowerBalance) {
  using R = TypeParam;
  const auto tau = this->rnea(this->v_, this->a_);
  const auto energy_at = [&](double t) {
    const typename TestFixture::VecV dq = this->v_ * t + this->a_ * (0.5 * t * t), v = this->v_ + this->a_ * t;
    Vec<double, R::nq> q;
    rbd_integrate<R>(this->q_.data(), dq.data(), q.data());
    rbd_kinematics<R>(q.data(), this->d_);
    Mat<double, R::nv, R::nv> M;
    rbd_crba<R>(this->d_, M);
    return 0.5 * v.dot(M * v) - this->d_.Yc[0].moment.dot(constant3<double>(R::gravity));  // joint 0 carries all bodies
  };
  // central difference: step 1e-4, error t^2/6 times a third derivative of up to 1e5 plus rounding of 1e3 J over the step
  const double t = 1e-4;
  EXPECT_NEAR((energy_at(t) - energy_at(-t)) / (2 * t), tau.dot(this->v_), 1e-3);
}

// J v of a frame is the velocity of its finite motion; the local Jacobian is the same seen from the frame.
TYPED_TEST(Dynamics, FrameJacobians) {
  using R = TypeParam;
  for (int frame = 0; frame < R::nframe; ++frame) {
    const double h = 1e-6;
    Mat3<double> rotation[2], R_WF;
    Vec3<double> position[2], p_WF;
    for (int side = 0; side < 2; ++side) {
      const typename TestFixture::VecV dq = this->v_ * (side ? h : -h);
      Vec<double, R::nq> q;
      rbd_integrate<R>(this->q_.data(), dq.data(), q.data());
      rbd_kinematics<R>(q.data(), this->d_);
      rbd_frame_placement<R>(this->d_, frame, rotation[side], position[side]);
    }
    rbd_kinematics<R>(this->q_.data(), this->d_);
    rbd_velocity<R>(this->v_.data(), this->d_);
    rbd_frame_placement<R>(this->d_, frame, R_WF, p_WF);
    Mat<double, 6, R::nv> J, J_local;
    rbd_frame_jacobian<R>(this->d_, frame, p_WF, J);
    rbd_frame_jacobian_local<R>(this->d_, frame, R_WF, p_WF, J_local);
    const Vec<double, 6> velocity = J * this->v_, local = J_local * this->v_;
    const Vec3<double> turn = log3<double>(rotation[0].transpose() * rotation[1]) / (2 * h);

    // central difference of numbers up to 10: 1e-12 of truncation, 1e-15 / 1e-6 of rounding
    const double tolerance = 1e-8;
    EXPECT_LT((velocity.template head<3>() - (position[1] - position[0]) / (2 * h)).norm(), tolerance);
    EXPECT_LT((local.template tail<3>() - turn).norm(), tolerance);
    EXPECT_LT((velocity.template head<3>() - R_WF * local.template head<3>()).norm(), kRounding);
    EXPECT_LT((velocity.template tail<3>() - R_WF * local.template tail<3>()).norm(), kRounding);

    Mat<double, 3, R::nv> J_point;
    rbd_point_jacobian<R>(this->d_, R::frame_joint[frame], p_WF, J_point);
    EXPECT_LT((J_point * this->v_ - velocity.template head<3>()).norm(), kRounding);
    EXPECT_LT((rbd_point_velocity<R>(this->d_, R::frame_joint[frame], p_WF) - velocity.template head<3>()).norm(), kRounding);
  }
}

}  // namespace
}  // namespace engram::test
