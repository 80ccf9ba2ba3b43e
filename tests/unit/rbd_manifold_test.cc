// exp and log of SO(3) and SE(3), their Jacobians, and the configuration manifold.
#include <gtest/gtest.h>

#include "controller/rbd/rbd_manifold.h"
#include "tests/unit/rbd_test_robots.h"

namespace engram::test {
namespace {

using Robot = Bush<kFree>;
using Vec6 = Vec<double, 6>;
using Mat6 = Mat<double, 6, 6>;

// A dozen operations on numbers of order 1; near an angle of pi, log divides by a sine that has lost two digits.
constexpr double kRounding = 1e-13;
// h^2/6 of third derivatives of order 10, and eps / h, at h = 1e-5
constexpr double kStep = 1e-5, kDifference = 1e-8;

// Angles from zero through the switch to the series (0.707) almost to pi.
constexpr double kAngles[] = {0.0, 1e-300, 1e-9, 1e-5, 0.01, 0.3, 0.7071, 0.7072, 1.0, 2.0, 3.0, 3.14};

Motion<double> motion(const Vec6& m) { return {m.head<3>(), m.tail<3>()}; }
Vec6 vec6(const Motion<double>& m) { return (Vec6() << m.lin, m.ang).finished(); }

// log6(exp6(a)^-1 exp6(b))
Vec6 twist_between(const Vec6& a, const Vec6& b) {
  Mat3<double> Ra, Rb;
  Vec3<double> pa, pb;
  exp6(motion(a), Ra, pa);
  exp6(motion(b), Rb, pb);
  return vec6(log6<double>(Ra.transpose() * Rb, Ra.transpose() * (pb - pa)));
}

class Twist : public ::testing::TestWithParam<double> {
 protected:
  Random random_{13};
  Vec6 m_;
  void SetUp() override {
    m_ = random_.vector<6>();
    m_.tail<3>() = m_.tail<3>().normalized() * GetParam();
  }
};

TEST_P(Twist, LogUndoesExp) {
  Mat3<double> R;
  Vec3<double> p;
  exp6(motion(m_), R, p);
  EXPECT_LT((R.transpose() * R - Mat3<double>::Identity()).cwiseAbs().maxCoeff(), kRounding);
  EXPECT_LT((vec6(log6(R, p)) - m_).cwiseAbs().maxCoeff(), kRounding);
}

// exp by its power series of the 4x4 matrix [[w]x u; 0 0]: knows nothing of the closed forms
TEST_P(Twist, ExpIsThePowerSeries) {
  Eigen::Matrix4d X = Eigen::Matrix4d::Zero(), term = Eigen::Matrix4d::Identity(), sum = term;
  X.topLeftCorner<3, 3>() = skew<double>(m_.tail<3>());
  X.topRightCorner<3, 1>() = m_.head<3>();
  for (int n = 1; n < 40; ++n) {
    term = term * X / n;
    sum += term;
  }
  Mat3<double> R;
  Vec3<double> p;
  exp6(motion(m_), R, p);
  EXPECT_LT((R - sum.topLeftCorner<3, 3>()).cwiseAbs().maxCoeff(), kRounding);
  EXPECT_LT((p - sum.topRightCorner<3, 1>()).cwiseAbs().maxCoeff(), kRounding);
}

TEST_P(Twist, JacobiansAreTheDifferences) {
  Mat3<double> R;
  Vec3<double> p;
  exp6(motion(m_), R, p);
  const Mat6 Jlog = jlog6<double>(m_.tail<3>(), p), Jexp = jexp6(motion(m_));
  // numbers of order 1 over (1 - cos): at 3.14 the inverse loses five digits
  EXPECT_LT((Jlog * Jexp - Mat6::Identity()).cwiseAbs().maxCoeff(), 1e-10);
  for (int k = 0; k < 6; ++k) {
    const Vec6 e = Vec6::Unit(k) * kStep;
    const Vec6 column = (twist_between(m_, m_ + e) - twist_between(m_, m_ - e)) / (2 * kStep);
    EXPECT_LT((Jexp.col(k) - column).cwiseAbs().maxCoeff(), kDifference) << "column " << k;
  }
  EXPECT_LT((jlog3<double>(m_.tail<3>()) * jexp3<double>(m_.tail<3>()) - Mat3<double>::Identity()).cwiseAbs().maxCoeff(), 1e-12);
}
INSTANTIATE_TEST_SUITE_P(Angles, Twist, ::testing::ValuesIn(kAngles));

TEST(Rotation, LogOfHalfTurnsHasLengthPi) {
  for (const Vec3<double>& axis :
       {Vec3<double>(1, 0, 0), Vec3<double>(0, 1, 0), Vec3<double>(0, 0, 1), Vec3<double>(0.6, 0, -0.8)}) {
    const Mat3<double> R = 2 * axis * axis.transpose() - Mat3<double>::Identity();
    const Vec3<double> w = log3(R);
    EXPECT_NEAR(w.norm(), 3.14159265358979323846, kRounding);
    EXPECT_NEAR(std::fabs(w.dot(axis)), 3.14159265358979323846, kRounding);
  }
}

TEST(Configuration, DifferenceUndoesIntegrate) {
  Random random(17);
  for (int trial = 0; trial < 100; ++trial) {
    const Vec<double, Robot::nq> q = random.configuration<Robot>();
    const Vec<double, Robot::nv> dq = random.vector<Robot::nv>() * (trial % 2 ? 1.5 : 1e-6);
    Vec<double, Robot::nq> moved;
    Vec<double, Robot::nv> back;
    rbd_integrate<Robot>(q.data(), dq.data(), moved.data());
    rbd_difference<Robot>(q.data(), moved.data(), back.data());
    EXPECT_LT((back - dq).cwiseAbs().maxCoeff(), kRounding);
    EXPECT_NEAR((moved.segment<4>(3).norm()), 1.0, 4e-16);
    EXPECT_GT((moved.segment<4>(3).dot(q.segment<4>(3))), 0.0);  // no jump to the other cover
  }
}

TEST(Configuration, NegatedQuaternionIsTheSamePlacement) {
  Random random(19);
  const Vec<double, Robot::nq> q = random.configuration<Robot>();
  Vec<double, Robot::nq> other = q;
  other.segment<4>(3) *= -1.0;
  Vec<double, Robot::nv> dq;
  rbd_difference<Robot>(q.data(), other.data(), dq.data());
  EXPECT_LT(dq.cwiseAbs().maxCoeff(), kRounding);
}

TEST(Configuration, JacobiansAreTheDifferences) {
  constexpr int nq = Robot::nq, nv = Robot::nv;
  using VecQ = Vec<double, nq>;
  using VecV = Vec<double, nv>;
  Random random(23);
  const VecQ q = random.configuration<Robot>(), q1 = random.configuration<Robot>();
  const VecV dq = random.vector<nv>();
  const auto plus = [](const VecQ& q, const VecV& dq) {
    VecQ out;
    rbd_integrate<Robot>(q.data(), dq.data(), out.data());
    return out;
  };
  const auto minus = [](const VecQ& q1, const VecQ& q0) {
    VecV out;
    rbd_difference<Robot>(q0.data(), q1.data(), out.data());
    return out;
  };
  Mat6 E, G, J0, J1;
  rbd_integrate_jacobians(dq.data(), E, G);
  rbd_difference_jacobians(q.data(), q1.data(), J0, J1);
  for (int k = 0; k < 6; ++k) {
    const VecV e = VecV::Unit(k) * kStep;
    const auto column = [&](const VecV& difference) { return Vec6(difference.head<6>() / (2 * kStep)); };
    EXPECT_LT((E.col(k) - column(minus(plus(plus(q, e), dq), plus(plus(q, -e), dq)))).cwiseAbs().maxCoeff(), kDifference);
    EXPECT_LT((G.col(k) - column(minus(plus(q, dq + e), plus(q, dq - e)))).cwiseAbs().maxCoeff(), kDifference);
    EXPECT_LT((J1.col(k) - column(minus(plus(q1, e), q) - minus(plus(q1, -e), q))).cwiseAbs().maxCoeff(), kDifference);
    EXPECT_LT((J0.col(k) - column(minus(q1, plus(q, e)) - minus(q1, plus(q, -e)))).cwiseAbs().maxCoeff(), kDifference);
  }
}

}  // namespace
}  // namespace engram::test
