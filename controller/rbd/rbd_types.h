// Ground types of the rigid-body room: joint kinds and small vectors over a scalar S (double or Pack).
#ifndef CONTROLLER_RBD_RBD_TYPES_H_
#define CONTROLLER_RBD_RBD_TYPES_H_

#include "controller/rbd/rbd_math.h"
#include "controller/rbd/rbd_pack.h"

#include <Eigen/Core>
#include <cstdint>

namespace engram {

// A joint moves its body along or about +z of its own frame, or freely.
enum class JointKind : uint8_t { kFree, kRevolute, kPrismatic };
inline constexpr JointKind kFree = JointKind::kFree;
inline constexpr JointKind kRevolute = JointKind::kRevolute;
inline constexpr JointKind kPrismatic = JointKind::kPrismatic;

// 3-vectors and 3x3 matrices are Eigen's, but copied, added and scaled entry by entry: Eigen moves them in blocks of two or four
// doubles, and a wide load right after narrow stores has to wait for them; that wait cost more than all arithmetic.
template <class S> struct Vec3 : Eigen::Matrix<S, 3, 1> {
  using Base = Eigen::Matrix<S, 3, 1>;

  Vec3() = default;
  ENGRAM_INLINE Vec3(const S& x, const S& y, const S& z) : Base(x, y, z) {}
  ENGRAM_INLINE Vec3(const Vec3& o) : Base(o[0], o[1], o[2]) {}
  template <class D> ENGRAM_INLINE Vec3(const Eigen::MatrixBase<D>& o) : Base(o) {}  // NOLINT: implicit as Eigen's
  ENGRAM_INLINE Vec3& operator=(const Vec3& o) {
    const S x = o[0], y = o[1], z = o[2];
    (*this)[0] = x;
    (*this)[1] = y;
    (*this)[2] = z;
    return *this;
  }
  template <class D> ENGRAM_INLINE Vec3& operator=(const Eigen::MatrixBase<D>& o) {
    Base::operator=(o);
    return *this;
  }
  ENGRAM_INLINE Vec3& operator+=(const Vec3& b) { return *this = {(*this)[0] + b[0], (*this)[1] + b[1], (*this)[2] + b[2]}; }
};

// For two of these only: mixed with Eigen's expressions, Eigen's operators hold.
template <class S> ENGRAM_INLINE Vec3<S> operator+(const Vec3<S>& a, const Vec3<S>& b) {
  return {a[0] + b[0], a[1] + b[1], a[2] + b[2]};
}
template <class S> ENGRAM_INLINE Vec3<S> operator-(const Vec3<S>& a, const Vec3<S>& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
template <class S> ENGRAM_INLINE Vec3<S> operator-(const Vec3<S>& a) { return {-a[0], -a[1], -a[2]}; }
template <class S> ENGRAM_INLINE Vec3<S> operator*(const Vec3<S>& a, const S& s) { return {a[0] * s, a[1] * s, a[2] * s}; }

template <class S> struct Mat3 : Eigen::Matrix<S, 3, 3> {
  using Base = Eigen::Matrix<S, 3, 3>;

  Mat3() = default;
  ENGRAM_INLINE Mat3(const Mat3& o) : Base() { *this = o; }
  ENGRAM_INLINE Mat3(const Vec3<S>& x, const Vec3<S>& y, const Vec3<S>& z) {
    set_column(0, x);
    set_column(1, y);
    set_column(2, z);
  }
  template <class D> ENGRAM_INLINE Mat3(const Eigen::MatrixBase<D>& o) : Base(o) {}  // NOLINT: implicit as Eigen's
  ENGRAM_INLINE Mat3& operator=(const Mat3& o) {
    set_column(0, o.column(0));
    set_column(1, o.column(1));
    set_column(2, o.column(2));
    return *this;
  }
  template <class D> ENGRAM_INLINE Mat3& operator=(const Eigen::MatrixBase<D>& o) {
    Base::operator=(o);
    return *this;
  }
  ENGRAM_INLINE Mat3& operator+=(const Mat3& b) {
    set_column(0, column(0) + b.column(0));
    set_column(1, column(1) + b.column(1));
    set_column(2, column(2) + b.column(2));
    return *this;
  }
  ENGRAM_INLINE Vec3<S> column(int j) const { return {(*this)(0, j), (*this)(1, j), (*this)(2, j)}; }
  ENGRAM_INLINE Vec3<S> row_vector(int i) const { return {(*this)(i, 0), (*this)(i, 1), (*this)(i, 2)}; }
  ENGRAM_INLINE void set_column(int j, const Vec3<S>& c) {
    const S x = c[0], y = c[1], z = c[2];
    (*this)(0, j) = x;
    (*this)(1, j) = y;
    (*this)(2, j) = z;
  }
};

template <class S, int n> using Vec = Eigen::Matrix<S, n, 1>;
// Row-major: a row of coefficients is contiguous.
template <class S, int m, int n> using Mat = Eigen::Matrix<S, m, n, (n == 1 ? Eigen::ColMajor : Eigen::RowMajor)>;

// A constant 3-vector or 3x3 matrix (row-major data) broadcast to S.
template <class S> ENGRAM_INLINE Vec3<S> constant3(const double* c) { return Vec3<S>(S(c[0]), S(c[1]), S(c[2])); }
template <class S> ENGRAM_INLINE Mat3<S> constant33(const double* c) {
  return {{S(c[0]), S(c[3]), S(c[6])}, {S(c[1]), S(c[4]), S(c[7])}, {S(c[2]), S(c[5]), S(c[8])}};
}

}  // namespace engram
#endif  // CONTROLLER_RBD_RBD_TYPES_H_
