// The dense kernels against Eigen, at sizes with and without remainders.
#include "controller/fddp/fddp_kernels.h"

#include <Eigen/Cholesky>
#include <Eigen/Dense>
#include <gtest/gtest.h>

namespace engram {
namespace {

using Dense = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

// Rows padded to the vector width, 64-byte aligned; the padding is zero.
template <int m, int n> struct Padded {
  static constexpr int ld = padded(n);
  alignas(64) double a[m][ld] = {};
  double* data() { return &a[0][0]; }
  void set(const Dense& M) {
    for (int i = 0; i < m; ++i)
      for (int j = 0; j < n; ++j) a[i][j] = M(i, j);
  }
  Dense get() const { return Eigen::Map<const Dense>(&a[0][0], m, ld).leftCols(n); }
};

// depth <= 50 products of order 1: rounding stays below depth * eps * size
constexpr double kTolerance = 1e-12;

template <int m, int n, int depth> void expect_products() {
  const Dense A = Dense::Random(depth, m), B = Dense::Random(depth, n), C = Dense::Random(m, n);
  Padded<depth, m> a;
  Padded<depth, n> b;
  Padded<m, n> c;
  a.set(A);
  b.set(B);
  c.set(C);
  kernel::product<m, padded(n), depth>(a.data(), a.ld, b.data(), b.ld, c.data(), c.ld);
  EXPECT_LT((c.get() - (C + A.transpose() * B)).cwiseAbs().maxCoeff(), kTolerance);
  kernel::product<m, padded(n), depth, kernel::Sign::kMinus>(a.data(), a.ld, b.data(), b.ld, c.data(), c.ld);
  EXPECT_LT((c.get() - C).cwiseAbs().maxCoeff(), kTolerance);
}

template <int m, int depth> void expect_lower() {
  const Dense A = Dense::Random(depth, m), B = Dense::Random(depth, m), C = Dense::Random(m, m);
  Padded<depth, m> a, b;
  Padded<m, m> c;
  a.set(A);
  b.set(B);
  c.set(C);
  kernel::product_lower<m, depth>(a.data(), a.ld, b.data(), b.ld, c.data(), c.ld);
  const Dense expected = C + A.transpose() * B;
  for (int i = 0; i < m; ++i)
    for (int j = 0; j <= i; ++j) EXPECT_NEAR(c.a[i][j], expected(i, j), kTolerance);
}

template <int n, int m> void expect_cholesky() {
  Dense A = Dense::Random(n, n), B = Dense::Random(n, m);
  A = A * A.transpose() + Dense::Identity(n, n);
  Padded<n, n> a;
  Padded<n, m> b;
  a.set(A);
  b.set(B);
  double inv[n];
  ASSERT_TRUE(kernel::cholesky<n>(a.data(), a.ld, inv));
  kernel::solve_lower<n, padded(m)>(a.data(), a.ld, inv, b.data(), b.ld);
  kernel::solve_lower_transposed<n, padded(m)>(a.data(), a.ld, inv, b.data(), b.ld);
  EXPECT_LT((A * b.get() - B).cwiseAbs().maxCoeff(), 1e-10);  // residual grows with the condition number, below 1e3 here
  A(n - 1, n - 1) = -1.0;
  a.set(A);
  EXPECT_FALSE(kernel::cholesky<n>(a.data(), a.ld, inv));
  A(0, 0) = std::nan("");
  a.set(A);
  EXPECT_FALSE(kernel::cholesky<n>(a.data(), a.ld, inv));
}

TEST(FddpKernels, ProductsEqualEigen) {
  expect_products<7, 21, 7>();
  expect_products<1, 4, 1>();
  expect_products<38, 108, 38>();
  expect_products<5, 13, 3>();
}
TEST(FddpKernels, LowerProductsEqualEigen) {
  expect_lower<21, 7>();
  expect_lower<1, 1>();
  expect_lower<50, 32>();
}
TEST(FddpKernels, CholeskySolvesAndRefuses) {
  expect_cholesky<7, 14>();
  expect_cholesky<1, 3>();
  expect_cholesky<32, 76>();
}

}  // namespace
}  // namespace engram
