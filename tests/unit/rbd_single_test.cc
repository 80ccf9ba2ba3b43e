// link: engram_core
// options: -Og -DENGRAM_SINGLE
// The room in single precision: elementary functions in units of the last place, dynamics against its own inverses.
#include <gtest/gtest.h>

#include "controller/rbd/rbd_aba.h"
#include "controller/rbd/rbd_derivatives_rows.h"
#include "tests/unit/rbd_test_robots.h"

#include <Eigen/Eigenvalues>

namespace engram::test {
namespace {

static_assert(std::is_same_v<Real, float> && lanes_of<Pack> == 2 * ENGRAM_LANES);
constexpr double kRounding = 0x1p-24;

// Argument reduction by pi/2 = 2^-8 (...) + rest leaves |n| 2^-33 <= 2^-24 for |a| < 1e3; near a zero that error is absolute.
TEST(Single, SineAndCosineUpTo1e3) {
  Random random(5);
  double worst = 0.0;
  for (int i = 0; i < 200000; ++i) {
    const float a = float(random() * (i % 2 ? 1e3 : 4.0));
    float s, c;
    sincos(a, s, c);
    worst = std::max({worst, std::fabs(s - std::sin(double(a))), std::fabs(c - std::cos(double(a)))});
  }
  EXPECT_LT(worst, 2 * kRounding);
}

template <class R, class S> struct Dynamics {
  S q[R::nq], v[R::nv], a[R::nv], tau[R::nv], forward[R::nv], articulated[R::nv];
  RbdData<R, S> d;
  Mat<S, R::nv, R::nv> M;

  void compute() {
    rbd_rnea(q, v, a, d, tau);
    rbd_aba(q, v, tau, d, articulated);
    rbd_forward_dynamics(q, v, tau, d, forward);
    rbd_crba(d, M);
  }
};

template <class R> class SingleDynamics : public ::testing::Test {};
TYPED_TEST_SUITE(SingleDynamics, AllRobots);

// tau(a) carries some 30 roundings of its largest terms; the way back multiplies errors by the condition of M.
TYPED_TEST(SingleDynamics, ForwardUndoesInverseInEveryLane) {
  using R = TypeParam;
  constexpr int nv = R::nv;
  Random random(7);
  static Dynamics<R, Pack> lanes;
  static Dynamics<R, float> one[kLanes];
  for (int l = 0; l < kLanes; ++l) {
    const auto q = random.configuration<R>();
    for (int i = 0; i < R::nq; ++i) lanes.q[i].set(l, one[l].q[i] = float(q[i]));
    for (int i = 0; i < nv; ++i) {
      lanes.v[i].set(l, one[l].v[i] = float(random()));
      lanes.a[i].set(l, one[l].a[i] = float(random()));
    }
    one[l].compute();
  }
  lanes.compute();
  for (int l = 0; l < kLanes; ++l) {
    Eigen::Matrix<double, nv, nv> M;
    double largest = 0.0;
    int different = 0;
    for (int i = 0; i < nv; ++i) {
      largest = std::max(largest, std::fabs(double(one[l].tau[i])));
      different += !(lanes.tau[i][l] == one[l].tau[i]) + !(lanes.forward[i][l] == one[l].forward[i]);
      for (int j = 0; j < nv; ++j) M(i, j) = one[l].M(i, j);
    }
    EXPECT_EQ(different, 0) << "lane " << l;
    const Eigen::VectorXd eigenvalues = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(M).eigenvalues();
    ASSERT_GT(eigenvalues[0], 0.0);
    const double bound = 30 * kRounding * largest / eigenvalues[0];
    for (int i = 0; i < nv; ++i) {
      EXPECT_NEAR(one[l].forward[i], one[l].a[i], bound);
      EXPECT_NEAR(one[l].articulated[i], one[l].a[i], bound);
    }
  }
}

}  // namespace
}  // namespace engram::test
