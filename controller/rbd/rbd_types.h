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

template <class S> using Vec3 = Eigen::Matrix<S, 3, 1>;
template <class S> using Mat3 = Eigen::Matrix<S, 3, 3>;
template <class S, int n> using Vec = Eigen::Matrix<S, n, 1>;
// Row-major: a row of coefficients is contiguous.
template <class S, int m, int n> using Mat = Eigen::Matrix<S, m, n, (n == 1 ? Eigen::ColMajor : Eigen::RowMajor)>;

// A constant 3-vector or 3x3 matrix (row-major data) broadcast to S.
template <class S> inline Vec3<S> constant3(const double* c) { return Vec3<S>(S(c[0]), S(c[1]), S(c[2])); }
template <class S> inline Mat3<S> constant33(const double* c) {
  Mat3<S> m;
  m << S(c[0]), S(c[1]), S(c[2]), S(c[3]), S(c[4]), S(c[5]), S(c[6]), S(c[7]), S(c[8]);
  return m;
}

}  // namespace engram
#endif  // CONTROLLER_RBD_RBD_TYPES_H_
