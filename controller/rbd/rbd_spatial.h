// Spatial algebra over a scalar S, every quantity at the world origin in world axes: nothing has to be moved between links, a
// sum over a subtree is a plain sum. Linear part first, as in q, v and J.
// Source: Featherstone, Rigid Body Dynamics Algorithms (2008), chapter 2.
//
// Products are spelled out so that double and Pack round alike, whatever vectorisation Eigen would pick for double.
#ifndef CONTROLLER_RBD_RBD_SPATIAL_H_
#define CONTROLLER_RBD_RBD_SPATIAL_H_

#include "controller/rbd/rbd_types.h"

namespace engram {

template <class S> inline S dot(const Vec3<S>& a, const Vec3<S>& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

template <class S> inline Vec3<S> cross(const Vec3<S>& a, const Vec3<S>& b) {
  return Vec3<S>(a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]);
}

// y = A x
template <class S> inline Vec3<S> mul(const Mat3<S>& A, const Vec3<S>& x) {
  return Vec3<S>(A(0, 0) * x[0] + A(0, 1) * x[1] + A(0, 2) * x[2], A(1, 0) * x[0] + A(1, 1) * x[1] + A(1, 2) * x[2],
                 A(2, 0) * x[0] + A(2, 1) * x[1] + A(2, 2) * x[2]);
}

// y = A' x
template <class S> inline Vec3<S> mul_transposed(const Mat3<S>& A, const Vec3<S>& x) {
  return Vec3<S>(A(0, 0) * x[0] + A(1, 0) * x[1] + A(2, 0) * x[2], A(0, 1) * x[0] + A(1, 1) * x[1] + A(2, 1) * x[2],
                 A(0, 2) * x[0] + A(1, 2) * x[1] + A(2, 2) * x[2]);
}

// C = A B
template <class S> inline Mat3<S> matmul(const Mat3<S>& A, const Mat3<S>& B) {
  Mat3<S> C;
  for (int j = 0; j < 3; ++j) C.col(j) = mul<S>(A, B.col(j));
  return C;
}

// C = A' B
template <class S> inline Mat3<S> matmul_transposed(const Mat3<S>& A, const Mat3<S>& B) {
  Mat3<S> C;
  for (int j = 0; j < 3; ++j) C.col(j) = mul_transposed<S>(A, B.col(j));
  return C;
}

// [a]x, so that [a]x b = a x b
template <class S> inline Mat3<S> skew(const Vec3<S>& a) {
  Mat3<S> A;
  A << S(0.0), -a[2], a[1], a[2], S(0.0), -a[0], -a[1], a[0], S(0.0);
  return A;
}

// Velocity, acceleration, or a Jacobian column: (u, w).
template <class S> struct Motion {
  Vec3<S> lin, ang;

  static Motion zero() { return {Vec3<S>::Zero(), Vec3<S>::Zero()}; }
  Motion& operator+=(const Motion& b) { lin += b.lin; ang += b.ang; return *this; }
  friend Motion operator+(Motion a, const Motion& b) { return a += b; }
  friend Motion operator-(const Motion& a, const Motion& b) { return {a.lin - b.lin, a.ang - b.ang}; }
  friend Motion operator*(const Motion& a, S s) { return {a.lin * s, a.ang * s}; }
};

// Force or momentum: (f, n), n about the world origin.
template <class S> struct Force {
  Vec3<S> lin, ang;

  static Force zero() { return {Vec3<S>::Zero(), Vec3<S>::Zero()}; }
  Force& operator+=(const Force& b) { lin += b.lin; ang += b.ang; return *this; }
  friend Force operator+(Force a, const Force& b) { return a += b; }
  friend Force operator-(const Force& a, const Force& b) { return {a.lin - b.lin, a.ang - b.ang}; }
  friend Force operator*(const Force& a, S s) { return {a.lin * s, a.ang * s}; }
};

// m . f (power)
template <class S> inline S dot(const Motion<S>& m, const Force<S>& f) { return dot(m.lin, f.lin) + dot(m.ang, f.ang); }

// a x b = (w_a x u_b + u_a x w_b, w_a x w_b)
template <class S> inline Motion<S> cross(const Motion<S>& a, const Motion<S>& b) {
  return {cross(a.ang, b.lin) + cross(a.lin, b.ang), cross(a.ang, b.ang)};
}

// m x* f = (w x f, w x n + u x f)
template <class S> inline Force<S> cross(const Motion<S>& m, const Force<S>& f) {
  return {cross(m.ang, f.lin), cross(m.ang, f.ang) + cross(m.lin, f.lin)};
}

// Mass, first moment m c [kg m] and rotational inertia about the world origin [kg m^2] as xx xy xz yy yz zz.
// A subtree's inertia is the sum of its bodies'.
template <class S> struct Inertia {
  S mass;
  Vec3<S> moment;
  S I[6];

  Inertia& operator+=(const Inertia& b) {
    mass += b.mass;
    moment += b.moment;
    for (int i = 0; i < 6; ++i) I[i] += b.I[i];
    return *this;
  }
};

template <class S> inline Vec3<S> mul_symmetric(const S* I, const Vec3<S>& w) {
  return Vec3<S>(I[0] * w[0] + I[1] * w[1] + I[2] * w[2], I[1] * w[0] + I[3] * w[1] + I[4] * w[2],
                 I[2] * w[0] + I[4] * w[1] + I[5] * w[2]);
}

// Y a = (m u - mc x w, I w + mc x u)
template <class S> inline Force<S> operator*(const Inertia<S>& Y, const Motion<S>& a) {
  return {a.lin * Y.mass - cross(Y.moment, a.ang), mul_symmetric(Y.I, a.ang) + cross(Y.moment, a.lin)};
}

// Inertia at the world origin of a body with rotation R_WJ, position p_WJ; constants `com` and `inertia` (about the com) in its axes:
//   I = R Ic R' + m (|c|^2 1 - c c')
template <class S>
inline Inertia<S> inertia_in_world(const Mat3<S>& R_WJ, const Vec3<S>& p_WJ, double mass, const double* com, const double* inertia) {
  const double Ic[3][3] = {{inertia[0], inertia[1], inertia[2]}, {inertia[1], inertia[3], inertia[4]}, {inertia[2], inertia[4], inertia[5]}};
  Mat3<S> T;  // R Ic
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) T(i, j) = R_WJ(i, 0) * Ic[0][j] + R_WJ(i, 1) * Ic[1][j] + R_WJ(i, 2) * Ic[2][j];
  }
  const auto rotated = [&](int i, int j) { return T(i, 0) * R_WJ(j, 0) + T(i, 1) * R_WJ(j, 1) + T(i, 2) * R_WJ(j, 2); };
  const Vec3<S> c = p_WJ + R_WJ.col(0) * S(com[0]) + R_WJ.col(1) * S(com[1]) + R_WJ.col(2) * S(com[2]);
  Inertia<S> Y;
  Y.mass = S(mass);
  Y.moment = c * S(mass);
  const S xx = Y.moment[0] * c[0], yy = Y.moment[1] * c[1], zz = Y.moment[2] * c[2];
  Y.I[0] = rotated(0, 0) + (yy + zz);
  Y.I[1] = rotated(0, 1) - Y.moment[0] * c[1];
  Y.I[2] = rotated(0, 2) - Y.moment[0] * c[2];
  Y.I[3] = rotated(1, 1) + (xx + zz);
  Y.I[4] = rotated(1, 2) - Y.moment[1] * c[2];
  Y.I[5] = rotated(2, 2) + (xx + yy);
  return Y;
}

}  // namespace engram
#endif  // CONTROLLER_RBD_RBD_SPATIAL_H_
