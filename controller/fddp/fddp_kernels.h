// Dense kernels of the Riccati sweep: fixed sizes, row-major, register-blocked, no remainders along a row.
//
// One product serves the whole sweep, because every left factor is either symmetric or wanted transposed:
//   C(i, j) += sign * sum_k A(k, i) B(k, j)
#ifndef CONTROLLER_FDDP_FDDP_KERNELS_H_
#define CONTROLLER_FDDP_FDDP_KERNELS_H_

#include "controller/ocp/ocp_knot_model.h"

#include <cmath>
#include <cstdint>

namespace engram::kernel {

typedef Real Vector __attribute__((vector_size(kVectorBytes), aligned(kVectorBytes), may_alias));

inline Vector& vec(Real* p) { return *reinterpret_cast<Vector*>(p); }
inline const Vector& vec(const Real* p) { return *reinterpret_cast<const Vector*>(p); }

enum class Sign { kPlus, kMinus };
enum class Start { kAdd, kSet };  // C += ... or C = ...

// Rows and vectors of a block of C, kept in registers over the whole sum: twelve and more hide the latency of the additions.
inline constexpr int kBlockRows = 4, kBlockVectors = kVectorBytes == 64 ? 4 : 3;

// Keeps the compiler from gathering the factors of several rows before their products: a block of C, one row of B and one factor are
// what sixteen registers hold.
inline __attribute__((always_inline)) void in_turn(Vector& c) {
#ifdef __x86_64__
  asm("" : "+v"(c));
#else
  static_cast<void>(c);
#endif
}

template <int mr, int nr, int depth, Sign sign, Start start>
inline __attribute__((always_inline)) void product_block(const Real* A, int lda, const Real* B, int ldb, Real* C, int ldc) {
  Vector c[mr][nr];
  for (int i = 0; i < mr; ++i)
    for (int j = 0; j < nr; ++j) c[i][j] = start == Start::kSet ? Vector{} : vec(C + i * ldc + j * kVector);
  for (int k = 0; k < depth; ++k) {
    Vector b[nr];
    for (int j = 0; j < nr; ++j) b[j] = vec(B + k * ldb + j * kVector);
    for (int i = 0; i < mr; ++i) {
      const Vector a = Vector{} + A[k * lda + i];
      for (int j = 0; j < nr; ++j) {
        if constexpr (sign == Sign::kPlus) c[i][j] += a * b[j];
        else c[i][j] -= a * b[j];
      }
      in_turn(c[i][0]);
    }
  }
  for (int i = 0; i < mr; ++i)
    for (int j = 0; j < nr; ++j) vec(C + i * ldc + j * kVector) = c[i][j];
}

// Rows first .. last of a panel of nr vectors: the panel of B stays in the first cache. first is a multiple of kBlockRows; rest is
// last % kBlockRows.
template <int nr, int rest, int depth, Sign sign, Start start>
__attribute__((noinline)) void product_panel(int first, int last, const Real* A, int lda, const Real* B, int ldb, Real* C, int ldc) {
  int i = first;
  for (; i + kBlockRows <= last; i += kBlockRows) product_block<kBlockRows, nr, depth, sign, start>(A + i, lda, B, ldb, C + i * ldc, ldc);
  if constexpr (rest > 0)
    if (i < last) product_block<rest, nr, depth, sign, start>(A + i, lda, B, ldb, C + i * ldc, ldc);
}

// Width of the panel at vector `at` of nv: kBlockVectors, but the last two share what is left rather than leave a thin one.
constexpr int panel_width(int at, int nv) {
  const int left = nv - at;
  return left <= kBlockVectors ? left : left == kBlockVectors + 1 ? (left + 1) / 2 : kBlockVectors;
}

// C (m x n) += sign A' B,  A (depth x m), B (depth x n); n a multiple of kVector.
template <int m, int n, int depth, Sign sign = Sign::kPlus, Start start = Start::kAdd, int at = 0>
inline void product(const Real* A, int lda, const Real* B, int ldb, Real* C, int ldc) {
  static_assert(n % kVector == 0);
  if constexpr (at < n / kVector) {
    constexpr int nr = panel_width(at, n / kVector), column = at * kVector;
    product_panel<nr, m % kBlockRows, depth, sign, start>(0, m, A, lda, B + column, ldb, C + column, ldc);
    product<m, n, depth, sign, start, at + nr>(A, lda, B, ldb, C, ldc);
  }
}

// The blocks of a panel that the diagonal cuts: `nr` vectors in the rows of vector nr of the panel.
template <int m, int row, int at, int width, int depth, Sign sign, Start start, int nr = 1>
inline void product_diagonal(const Real* A, int lda, const Real* B, int ldb, Real* C, int ldc) {
  if constexpr (nr <= width) {
    constexpr int first = (at + nr - 1) * kVector, last = first + kVector < m ? first + kVector : m;
    if constexpr (first >= row && first < m)
      product_panel<nr, m % kBlockRows, depth, sign, start>(first, last, A, lda, B + at * kVector, ldb, C + at * kVector, ldc);
    product_diagonal<m, row, at, width, depth, sign, start, nr + 1>(A, lda, B, ldb, C, ldc);
  }
}

// Lower triangle of a symmetric C (m x m), from `row` (a multiple of kVector) on, += sign A' B, up to the vector of the diagonal.
template <int m, int depth, Sign sign = Sign::kPlus, int row = 0, Start start = Start::kAdd, int at = 0>
inline void product_lower(const Real* A, int lda, const Real* B, int ldb, Real* C, int ldc) {
  static_assert(row % kVector == 0);
  constexpr int nv = padded(m) / kVector;
  if constexpr (at < nv) {
    constexpr int nr = panel_width(at, nv), below = (at + nr) * kVector < row ? row : (at + nr) * kVector;
    product_diagonal<m, row, at, nr, depth, sign, start>(A, lda, B, ldb, C, ldc);
    if constexpr (below < m)
      product_panel<nr, m % kBlockRows, depth, sign, start>(below, m, A, lda, B + at * kVector, ldb, C + at * kVector, ldc);
    product_lower<m, depth, sign, row, start, at + nr>(A, lda, B, ldb, C, ldc);
  }
}

// y (n) += sign A' x,  A (depth x n), n a multiple of kVector.
template <int n, int depth, Sign sign = Sign::kPlus, int at = 0> inline void product_vector(const Real* A, int lda, const Real* x, Real* y) {
  static_assert(n % kVector == 0);
  if constexpr (at < n) {
    constexpr int nr = (n - at) / kVector < 10 ? (n - at) / kVector : 10;
    Vector c[nr];
    for (int j = 0; j < nr; ++j) c[j] = vec(y + at + j * kVector);
    for (int k = 0; k < depth; ++k)
      for (int j = 0; j < nr; ++j) {
        if constexpr (sign == Sign::kPlus) c[j] += x[k] * vec(A + k * lda + at + j * kVector);
        else c[j] -= x[k] * vec(A + k * lda + at + j * kVector);
      }
    for (int j = 0; j < nr; ++j) vec(y + at + j * kVector) = c[j];
    product_vector<n, depth, sign, at + nr * kVector>(A, lda, x, y);
  }
}

// y (n) = S x for symmetric S of which the full matrix is stored; n a multiple of kVector.
template <int n> inline void symmetric_vector(const Real* S, int lds, const Real* x, Real* y) {
  for (int j = 0; j < n; j += kVector) vec(y + j) = Vector{};
  product_vector<n, n>(S, lds, x, y);
}

// Copies the lower triangle of C (m x m) to the upper, in blocks of 4 x 4 that are turned in registers; m a multiple of 4.
template <int m> inline void mirror_lower(Real* C, int ldc) {
  static_assert(m % 4 == 0);
  typedef Real Four __attribute__((vector_size(4 * sizeof(Real)), aligned(4 * sizeof(Real)), may_alias));
  typedef Bits Pick __attribute__((vector_size(4 * sizeof(Real))));
  for (int i = 0; i < m; i += 4) {
    for (int j = 0; j < i; j += 4) {
      const Four* const r[4] = {reinterpret_cast<Four*>(C + i * ldc + j), reinterpret_cast<Four*>(C + (i + 1) * ldc + j),
                                reinterpret_cast<Four*>(C + (i + 2) * ldc + j), reinterpret_cast<Four*>(C + (i + 3) * ldc + j)};
      const Four even01 = __builtin_shuffle(*r[0], *r[1], Pick{0, 4, 2, 6}), odd01 = __builtin_shuffle(*r[0], *r[1], Pick{1, 5, 3, 7});
      const Four even23 = __builtin_shuffle(*r[2], *r[3], Pick{0, 4, 2, 6}), odd23 = __builtin_shuffle(*r[2], *r[3], Pick{1, 5, 3, 7});
      *reinterpret_cast<Four*>(C + j * ldc + i) = __builtin_shuffle(even01, even23, Pick{0, 1, 4, 5});
      *reinterpret_cast<Four*>(C + (j + 1) * ldc + i) = __builtin_shuffle(odd01, odd23, Pick{0, 1, 4, 5});
      *reinterpret_cast<Four*>(C + (j + 2) * ldc + i) = __builtin_shuffle(even01, even23, Pick{2, 3, 6, 7});
      *reinterpret_cast<Four*>(C + (j + 3) * ldc + i) = __builtin_shuffle(odd01, odd23, Pick{2, 3, 6, 7});
    }
    for (int a = 1; a < 4; ++a)
      for (int b = 0; b < a; ++b) C[(i + b) * ldc + i + a] = C[(i + a) * ldc + i + b];
  }
}

// A = L L' in place (lower triangle of A (n x n)); inv_diagonal holds 1 / L(i, i). False if A is not positive definite.
template <int n> inline bool cholesky(Real* A, int lda, Real* inv_diagonal) {
  bool positive = true;
  for (int j = 0; j < n; ++j) {
    Real d = A[j * lda + j];
    for (int k = 0; k < j; ++k) d -= A[j * lda + k] * A[j * lda + k];
    positive &= d > 0.0;  // false for NaN too
    const Real l = std::sqrt(positive ? d : 1.0);
    const Real inv = 1.0 / l;
    A[j * lda + j] = l;
    inv_diagonal[j] = inv;
    for (int i = j + 1; i < n; ++i) {
      Real s = A[i * lda + j];
      for (int k = 0; k < j; ++k) s -= A[i * lda + k] * A[j * lda + k];
      A[i * lda + j] = s * inv;
    }
  }
  return positive;
}

// Rows i .. i + mr of B <- L^-1 B, the rows before them done.
template <int mr, int nr>
inline __attribute__((always_inline)) void solve_lower_block(const Real* L, int ldl, const Real* inv_diagonal, int i, Real* B, int ldb) {
  Vector c[mr][nr];
  for (int r = 0; r < mr; ++r)
    for (int j = 0; j < nr; ++j) c[r][j] = vec(B + (i + r) * ldb + j * kVector);
  for (int k = 0; k < i; ++k) {
    Vector b[nr];
    for (int j = 0; j < nr; ++j) b[j] = vec(B + k * ldb + j * kVector);
    for (int r = 0; r < mr; ++r) {
      const Vector l = Vector{} + L[(i + r) * ldl + k];
      for (int j = 0; j < nr; ++j) c[r][j] -= l * b[j];
    }
  }
  for (int r = 0; r < mr; ++r)
    for (int j = 0; j < nr; ++j) {
      for (int k = 0; k < r; ++k) c[r][j] -= L[(i + r) * ldl + i + k] * c[k][j];
      c[r][j] *= inv_diagonal[i + r];
      vec(B + (i + r) * ldb + j * kVector) = c[r][j];
    }
}

// Rows i .. i + mr of B <- L'^-1 B, the rows after them, up to n, done.
template <int mr, int nr, int n>
inline __attribute__((always_inline)) void solve_lower_transposed_block(const Real* L, int ldl, const Real* inv_diagonal, int i, Real* B,
                                                                        int ldb) {
  Vector c[mr][nr];
  for (int r = 0; r < mr; ++r)
    for (int j = 0; j < nr; ++j) c[r][j] = vec(B + (i + r) * ldb + j * kVector);
  for (int k = i + mr; k < n; ++k) {
    Vector b[nr];
    for (int j = 0; j < nr; ++j) b[j] = vec(B + k * ldb + j * kVector);
    for (int r = 0; r < mr; ++r) {
      const Vector l = Vector{} + L[k * ldl + i + r];
      for (int j = 0; j < nr; ++j) c[r][j] -= l * b[j];
    }
  }
  for (int r = mr - 1; r >= 0; --r)
    for (int j = 0; j < nr; ++j) {
      for (int k = r + 1; k < mr; ++k) c[r][j] -= L[(i + k) * ldl + i + r] * c[k][j];
      c[r][j] *= inv_diagonal[i + r];
      vec(B + (i + r) * ldb + j * kVector) = c[r][j];
    }
}

// B <- L^-1 B (forward) for B (n x m), m a multiple of kVector.
template <int n, int m, int block = 0> inline void solve_lower(const Real* L, int ldl, const Real* inv_diagonal, Real* B, int ldb) {
  constexpr int nv = m / kVector, blocks = (nv + kBlockVectors - 1) / kBlockVectors, whole = n / kBlockRows * kBlockRows;
  if constexpr (block < blocks) {
    constexpr int first = nv * block / blocks, nr = nv * (block + 1) / blocks - first;
    Real* const at = B + first * kVector;
    for (int i = 0; i < whole; i += kBlockRows) solve_lower_block<kBlockRows, nr>(L, ldl, inv_diagonal, i, at, ldb);
    if constexpr (whole < n) solve_lower_block<n - whole, nr>(L, ldl, inv_diagonal, whole, at, ldb);
    solve_lower<n, m, block + 1>(L, ldl, inv_diagonal, B, ldb);
  }
}

// B <- L'^-1 B (backward) for B (n x m), m a multiple of kVector.
template <int n, int m, int block = 0>
inline void solve_lower_transposed(const Real* L, int ldl, const Real* inv_diagonal, Real* B, int ldb) {
  constexpr int nv = m / kVector, blocks = (nv + kBlockVectors - 1) / kBlockVectors, whole = n / kBlockRows * kBlockRows;
  if constexpr (block < blocks) {
    constexpr int first = nv * block / blocks, nr = nv * (block + 1) / blocks - first;
    Real* const at = B + first * kVector;
    if constexpr (whole < n) solve_lower_transposed_block<n - whole, nr, n>(L, ldl, inv_diagonal, whole, at, ldb);
    for (int i = whole - kBlockRows; i >= 0; i -= kBlockRows)
      solve_lower_transposed_block<kBlockRows, nr, n>(L, ldl, inv_diagonal, i, at, ldb);
    solve_lower_transposed<n, m, block + 1>(L, ldl, inv_diagonal, B, ldb);
  }
}

// Sum of the entries.
inline Real sum(Vector v) {
  Real s = 0.0;
  for (int i = 0; i < kVector; ++i) s += v[i];
  return s;
}

// y <- L^-1 y (forward) and L'^-1 y (backward) for y (n), padded with zeros; rows of L are padded with finite numbers.
template <int n> inline void solve_lower_vector(const Real* L, int ldl, const Real* inv_diagonal, Real* y) {
  for (int i = 0; i < n; ++i) {
    Vector s = {};
    int k = 0;
    for (; k + kVector <= i; k += kVector) s += vec(L + i * ldl + k) * vec(y + k);
    Real t = y[i] - sum(s);
    for (; k < i; ++k) t -= L[i * ldl + k] * y[k];
    y[i] = t * inv_diagonal[i];
  }
}
template <int n> inline void solve_lower_transposed_vector(const Real* L, int ldl, const Real* inv_diagonal, Real* y) {
  for (int i = n - 1; i >= 0; --i) {
    y[i] *= inv_diagonal[i];
    for (int k = 0; k < i; ++k) y[k] -= L[i * ldl + k] * y[i];
  }
}

}  // namespace engram::kernel
#endif  // CONTROLLER_FDDP_FDDP_KERNELS_H_
