// Analytic derivatives of inverse dynamics, forward dynamics and gravity against central differences.
#include <gtest/gtest.h>

#include "controller/rbd/rbd_derivatives_rows.h"
#include "controller/rbd/rbd_manifold.h"
#include "tests/unit/rbd_test_robots.h"

namespace engram::test {
namespace {

// Central differences of f: error h^2/6 |f'''| + eps |f| / h. With h = 1e-5 and, for all robots here, |f| <= 1e3 and |f'''| <= 1e4:
// 2e-7 + 2e-8.
constexpr double kStep = 1e-5;
constexpr double kDifference = 1e-6;

template <class R> class Derivatives : public ::testing::Test {
 protected:
  static constexpr int nq = R::nq, nv = R::nv;
  using VecQ = Vec<double, nq>;
  using VecV = Vec<double, nv>;
  using MatV = Mat<double, nv, nv>;

  Random random_{11};
  RbdData<R, double> d_;
  VecQ q_ = random_.configuration<R>();
  VecV v_ = random_.vector<nv>(), a_ = random_.vector<nv>();

  // column k: (f(q (+) h e_k) - f(q (-) h e_k)) / 2 h
  template <class F> MatV along_q(F f) {
    MatV D;
    for (int k = 0; k < nv; ++k) {
      VecQ q[2];
      for (int side = 0; side < 2; ++side) {
        const VecV dq = VecV::Unit(k) * (side ? kStep : -kStep);
        rbd_integrate<R>(q_.data(), dq.data(), q[side].data());
      }
      D.col(k) = (f(q[1]) - f(q[0])) / (2 * kStep);
    }
    return D;
  }
  template <class F> MatV along_vector(const VecV& x, F f) {
    MatV D;
    for (int k = 0; k < nv; ++k) D.col(k) = (f(x + VecV::Unit(k) * kStep) - f(x - VecV::Unit(k) * kStep)) / (2 * kStep);
    return D;
  }
  VecV rnea(const VecQ& q, const VecV& v, const VecV& a) {
    VecV tau;
    rbd_rnea<R>(q.data(), v.data(), a.data(), d_, tau.data());
    return tau;
  }
  VecV forward(const VecQ& q, const VecV& v, const VecV& tau) {
    VecV a;
    rbd_forward_dynamics<R>(q.data(), v.data(), tau.data(), d_, a.data());
    return a;
  }
  static double worst(const MatV& A, const MatV& B) { return (A - B).cwiseAbs().maxCoeff(); }
};
TYPED_TEST_SUITE(Derivatives, AllRobots);

TYPED_TEST(Derivatives, InverseDynamics) {
  const auto dq = this->along_q([&](const auto& q) { return this->rnea(q, this->v_, this->a_); });
  const auto dv = this->along_vector(this->v_, [&](const auto& v) { return this->rnea(this->q_, v, this->a_); });
  typename TestFixture::MatV dtau_dq, dtau_dv;
  this->rnea(this->q_, this->v_, this->a_);
  rbd_composite_inertias<TypeParam>(this->d_);
  rbd_rnea_derivatives<TypeParam>(this->d_, dtau_dq, dtau_dv);
  EXPECT_LT(this->worst(dtau_dq, dq), kDifference);
  EXPECT_LT(this->worst(dtau_dv, dv), kDifference);
  EXPECT_GT(dq.cwiseAbs().maxCoeff(), 1.0);  // there is something to compare
}

TYPED_TEST(Derivatives, ForwardDynamics) {
  // joint forces that keep the accelerations near 1
  const auto tau = this->rnea(this->q_, this->v_, this->a_);
  const auto dq = this->along_q([&](const auto& q) { return this->forward(q, this->v_, tau); });
  const auto dv = this->along_vector(this->v_, [&](const auto& v) { return this->forward(this->q_, v, tau); });
  const auto dtau = this->along_vector(tau, [&](const auto& t) { return this->forward(this->q_, this->v_, t); });
  typename TestFixture::MatV da_dq, da_dv, Minv;
  const auto a = this->forward(this->q_, this->v_, tau);
  rbd_forward_derivatives<TypeParam>(this->d_, a.data(), da_dq, da_dv, Minv);
  EXPECT_LT(this->worst(da_dq, dq), kDifference);
  EXPECT_LT(this->worst(da_dv, dv), kDifference);
  EXPECT_LT(this->worst(Minv, dtau), kDifference);

  typename TestFixture::MatV M;
  rbd_crba<TypeParam>(this->d_, M);
  // entries of M up to 1e2, of its inverse up to 1e3: 1e5 eps
  EXPECT_LT(this->worst(M * Minv, TestFixture::MatV::Identity()), 1e-11);
}

// The versions for one state do the same operations in the same order.
TYPED_TEST(Derivatives, ByRowsEqualByColumnsBitForBit) {
  constexpr int nv = TypeParam::nv;
  typename TestFixture::MatV by_columns[5];
  static RowMatrix<TypeParam> by_rows[5];
  const auto tau = this->rnea(this->q_, this->v_, this->a_);
  rbd_composite_inertias<TypeParam>(this->d_);
  rbd_rnea_derivatives<TypeParam>(this->d_, by_columns[0], by_columns[1]);
  rbd_rnea_derivatives<TypeParam>(this->d_, by_rows[0], by_rows[1]);
  auto a = this->forward(this->q_, this->v_, tau);
  rbd_forward_derivatives<TypeParam>(this->d_, a.data(), by_columns[2], by_columns[3], by_columns[4]);
  a = this->forward(this->q_, this->v_, tau);
  rbd_forward_derivatives<TypeParam>(this->d_, a.data(), by_rows[2], by_rows[3], by_rows[4]);
  for (int m = 0; m < 5; ++m) {
    int different = 0;
    for (int i = 0; i < nv; ++i)
      for (int j = 0; j < nv; ++j) different += !(by_rows[m](i, j) == by_columns[m](i, j));
    EXPECT_EQ(different, 0) << "matrix " << m;
  }
}

TYPED_TEST(Derivatives, Gravity) {
  const auto gravity = [&](const auto& q) {
    typename TestFixture::VecV g;
    rbd_kinematics<TypeParam>(q.data(), this->d_);
    rbd_gravity<TypeParam>(this->d_, g.data());
    return g;
  };
  const auto dq = this->along_q(gravity);
  typename TestFixture::MatV dg_dq;
  gravity(this->q_);
  rbd_gravity_derivatives<TypeParam>(this->d_, dg_dq);
  EXPECT_LT(this->worst(dg_dq, dq), kDifference);
  EXPECT_GT(dq.cwiseAbs().maxCoeff(), 1.0);
}

}  // namespace
}  // namespace engram::test
