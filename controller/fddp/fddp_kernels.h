// Dense kernels of the Riccati sweep: fixed sizes, row-major, register-blocked, no remainders along a row.
//
// One product serves the whole sweep, because every left factor is either symmetric or wanted transposed:
//   C(i, j) += sign * sum_k A(k, i) B(k, j)
#ifndef CONTROLLER_FDDP_FDDP_KERNELS_H_
#define CONTROLLER_FDDP_FDDP_KERNELS_H_

#include "controller/ocp/ocp_knot_model.h"

#include <cmath>

namespace engram::kernel {

typedef double Vector __attribute__((vector_size(kVector * sizeof(double)), aligned(kVector * sizeof(double)), may_alias));

inline Vector& vec(double* p) { return *reinterpret_cast<Vector*>(p); }
inline const Vector& vec(const double* p) { return *reinterpret_cast<const Vector*>(p); }

enum class Sign { kPlus, kMinus };

// A block of mr rows and nr vectors of C, kept in registers over the whole sum.
template <int mr, int nr, int depth, Sign sign>
inline __attribute__((always_inline)) void product_block(const double* A, int lda, const double* B, int ldb, double* C, int ldc) {
  Vector c[mr][nr];
  for (int i = 0; i < mr; ++i)
    for (int j = 0; j < nr; ++j) c[i][j] = vec(C + i * ldc + j * kVector);
  for (int k = 0; k < depth; ++k) {
    for (int j = 0; j < nr; ++j) {
      const Vector b = vec(B + k * ldb + j * kVector);
      for (int i = 0; i < mr; ++i) {
        if constexpr (sign == Sign::kPlus) c[i][j] += A[k * lda + i] * b;
        else c[i][j] -= A[k * lda + i] * b;
      }
    }
  }
  for (int i = 0; i < mr; ++i)
    for (int j = 0; j < nr; ++j) vec(C + i * ldc + j * kVector) = c[i][j];
}

template <int mr, int nv, int depth, Sign sign>
inline __attribute__((always_inline)) void product_row(const double* A, int lda, const double* B, int ldb, double* C, int ldc) {
  constexpr int nr = kVector == 8 ? 4 : 3;
  constexpr int whole = nv / nr * nr;
  for (int j = 0; j < whole; j += nr)
    product_block<mr, nr, depth, sign>(A, lda, B + j * kVector, ldb, C + j * kVector, ldc);
  if constexpr (nv > whole)
    product_block<mr, nv - whole, depth, sign>(A, lda, B + whole * kVector, ldb, C + whole * kVector, ldc);
}

// C (m x n) += sign A' B,  A (depth x m), B (depth x n); n a multiple of kVector.
template <int m, int n, int depth, Sign sign = Sign::kPlus>
inline void product(const double* A, int lda, const double* B, int ldb, double* C, int ldc) {
  static_assert(n % kVector == 0);
  constexpr int mr = 4, whole = m / mr * mr;
  for (int i = 0; i < whole; i += mr) product_row<mr, n / kVector, depth, sign>(A + i, lda, B, ldb, C + i * ldc, ldc);
  if constexpr (m > whole) product_row<m - whole, n / kVector, depth, sign>(A + whole, lda, B, ldb, C + whole * ldc, ldc);
}

// Lower triangle of a symmetric C (m x m) += sign A' B: row blocks stop at the diagonal.
template <int m, int depth, Sign sign = Sign::kPlus, int row = 0>
inline __attribute__((always_inline)) void product_lower(const double* A, int lda, const double* B, int ldb, double* C, int ldc) {
  if constexpr (row < m) {
    constexpr int mr = m - row < 4 ? m - row : 4;
    product_row<mr, padded(row + mr) / kVector, depth, sign>(A + row, lda, B, ldb, C + row * ldc, ldc);
    product_lower<m, depth, sign, row + mr>(A, lda, B, ldb, C, ldc);
  }
}

// y (n) += sign A' x,  A (depth x n), n a multiple of kVector.
template <int n, int depth, Sign sign = Sign::kPlus> inline void product_vector(const double* A, int lda, const double* x, double* y) {
  static_assert(n % kVector == 0);
  for (int k = 0; k < depth; ++k)
    for (int j = 0; j < n; j += kVector) {
      if constexpr (sign == Sign::kPlus) vec(y + j) += x[k] * vec(A + k * lda + j);
      else vec(y + j) -= x[k] * vec(A + k * lda + j);
    }
}

// y (n) = S x for symmetric S of which the full matrix is stored; n a multiple of kVector.
template <int n> inline void symmetric_vector(const double* S, int lds, const double* x, double* y) {
  for (int j = 0; j < n; j += kVector) vec(y + j) = Vector{};
  product_vector<n, n>(S, lds, x, y);
}

// Copies the lower triangle of C (m x m) to the upper.
template <int m> inline void mirror_lower(double* C, int ldc) {
  for (int i = 1; i < m; ++i)
    for (int j = 0; j < i; ++j) C[j * ldc + i] = C[i * ldc + j];
}

// A = L L' in place (lower triangle of A (n x n)); inv_diagonal holds 1 / L(i, i). False if A is not positive definite.
template <int n> inline bool cholesky(double* A, int lda, double* inv_diagonal) {
  bool positive = true;
  for (int j = 0; j < n; ++j) {
    double d = A[j * lda + j];
    for (int k = 0; k < j; ++k) d -= A[j * lda + k] * A[j * lda + k];
    positive &= d > 0.0;  // false for NaN too
    const double l = std::sqrt(positive ? d : 1.0);
    const double inv = 1.0 / l;
    A[j * lda + j] = l;
    inv_diagonal[j] = inv;
    for (int i = j + 1; i < n; ++i) {
      double s = A[i * lda + j];
      for (int k = 0; k < j; ++k) s -= A[i * lda + k] * A[j * lda + k];
      A[i * lda + j] = s * inv;
    }
  }
  return positive;
}

// B <- L^-1 B (forward) for B (n x m), m a multiple of kVector.
template <int n, int m> inline void solve_lower(const double* L, int ldl, const double* inv_diagonal, double* B, int ldb) {
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < m; j += kVector) {
      Vector s = vec(B + i * ldb + j);
      for (int k = 0; k < i; ++k) s -= L[i * ldl + k] * vec(B + k * ldb + j);
      vec(B + i * ldb + j) = s * inv_diagonal[i];
    }
  }
}

// B <- L'^-1 B (backward) for B (n x m), m a multiple of kVector.
template <int n, int m> inline void solve_lower_transposed(const double* L, int ldl, const double* inv_diagonal, double* B, int ldb) {
  for (int i = n - 1; i >= 0; --i) {
    for (int j = 0; j < m; j += kVector) {
      Vector s = vec(B + i * ldb + j);
      for (int k = i + 1; k < n; ++k) s -= L[k * ldl + i] * vec(B + k * ldb + j);
      vec(B + i * ldb + j) = s * inv_diagonal[i];
    }
  }
}

}  // namespace engram::kernel
#endif  // CONTROLLER_FDDP_FDDP_KERNELS_H_
