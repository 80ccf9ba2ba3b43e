// Linear combinations of long rows, kept in registers over the whole sum.
#ifndef CONTROLLER_OCP_OCP_DENSE_ROWS_H_
#define CONTROLLER_OCP_OCP_DENSE_ROWS_H_

#include "controller/ocp/ocp_knot_model.h"

namespace engram::dense_rows {

typedef Real Vector __attribute__((vector_size(kVectorBytes), aligned(kVectorBytes), may_alias));
inline Vector& vec(Real* p) { return *reinterpret_cast<Vector*>(p); }
inline const Vector& vec(const Real* p) { return *reinterpret_cast<const Vector*>(p); }

template <int nr>
inline __attribute__((always_inline)) void combine_block(Real* y, int at, int terms, const Real* coefficient, const Real* const* row,
                                                         Real scale) {
  Vector c[nr];
  for (int j = 0; j < nr; ++j) c[j] = vec(y + at + j * kVector);
  for (int t = 0; t < terms; ++t) {
    const Real a = coefficient[t];
    const Real* const x = row[t] + at;
    for (int j = 0; j < nr; ++j) c[j] += a * vec(x + j * kVector);
  }
  for (int j = 0; j < nr; ++j) vec(y + at + j * kVector) = scale * c[j];
}

// y <- scale (y + sum_t coefficient[t] row[t]), rows of n doubles, n a multiple of kVector.
template <int n> inline void combine(Real* y, int terms, const Real* coefficient, const Real* const* row, Real scale) {
  constexpr int nr = 7, whole = n / (nr * kVector) * nr * kVector, rest = (n - whole) / kVector;
  for (int at = 0; at < whole; at += nr * kVector) combine_block<nr>(y, at, terms, coefficient, row, scale);
  if constexpr (rest > 0) combine_block<rest>(y, whole, terms, coefficient, row, scale);
}

}  // namespace engram::dense_rows
#endif  // CONTROLLER_OCP_OCP_DENSE_ROWS_H_
