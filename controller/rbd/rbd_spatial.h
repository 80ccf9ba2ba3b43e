// Spatial algebra over a scalar S, every quantity at the world origin in world axes: nothing has to be moved between links, and the
// inertia or force of a subtree is a plain sum. Linear part first, as in q, v and J.
// Source: Featherstone, Rigid Body Dynamics Algorithms (2008), chapter 2.
//
// Products are chains of fused multiply-adds, spelled out: the fewest instructions, and the same rounding for double and Pack.
#ifndef CONTROLLER_RBD_RBD_SPATIAL_H_
#define CONTROLLER_RBD_RBD_SPATIAL_H_

#include "controller/rbd/rbd_types.h"

namespace engram {

// ---- 3-vectors and 3x3 matrices ----

template <class S> ENGRAM_INLINE S dot(const Vec3<S>& a, const Vec3<S>& b) {
  return madd(a[0], b[0], madd(a[1], b[1], a[2] * b[2]));
}
// c + a . b
template <class S> ENGRAM_INLINE S dot_add(const Vec3<S>& a, const Vec3<S>& b, S c) {
  return madd(a[0], b[0], madd(a[1], b[1], madd(a[2], b[2], c)));
}

// a x b
template <class S> ENGRAM_INLINE Vec3<S> cross(const Vec3<S>& a, const Vec3<S>& b) {
  return {msub(a[1], b[2], a[2] * b[1]), msub(a[2], b[0], a[0] * b[2]), msub(a[0], b[1], a[1] * b[0])};
}
// c + a x b
template <class S> ENGRAM_INLINE Vec3<S> cross_add(const Vec3<S>& a, const Vec3<S>& b, const Vec3<S>& c) {
  return {madd(a[1], b[2], nmadd(a[2], b[1], c[0])), madd(a[2], b[0], nmadd(a[0], b[2], c[1])),
          madd(a[0], b[1], nmadd(a[1], b[0], c[2]))};
}

// a s + b
template <class S> ENGRAM_INLINE Vec3<S> madd(const Vec3<S>& a, S s, const Vec3<S>& b) {
  return {madd(a[0], s, b[0]), madd(a[1], s, b[1]), madd(a[2], s, b[2])};
}

// A x, written as a sum of columns
template <class S> ENGRAM_INLINE Vec3<S> mul(const Mat3<S>& A, const Vec3<S>& x) {
  const auto row = [&](int i) ENGRAM_INLINE_LAMBDA { return madd(A(i, 0), x[0], madd(A(i, 1), x[1], A(i, 2) * x[2])); };
  return {row(0), row(1), row(2)};
}
// y + A x
template <class S> ENGRAM_INLINE Vec3<S> mul_add(const Mat3<S>& A, const Vec3<S>& x, const Vec3<S>& y) {
  const auto row = [&](int i) ENGRAM_INLINE_LAMBDA { return madd(A(i, 0), x[0], madd(A(i, 1), x[1], madd(A(i, 2), x[2], y[i]))); };
  return {row(0), row(1), row(2)};
}
// A' x and y + A' x
template <class S> ENGRAM_INLINE Vec3<S> mul_transposed(const Mat3<S>& A, const Vec3<S>& x) {
  const auto row = [&](int i) ENGRAM_INLINE_LAMBDA { return madd(A(0, i), x[0], madd(A(1, i), x[1], A(2, i) * x[2])); };
  return {row(0), row(1), row(2)};
}
template <class S> ENGRAM_INLINE Vec3<S> mul_transposed_add(const Mat3<S>& A, const Vec3<S>& x, const Vec3<S>& y) {
  const auto row = [&](int i) ENGRAM_INLINE_LAMBDA { return madd(A(0, i), x[0], madd(A(1, i), x[1], madd(A(2, i), x[2], y[i]))); };
  return {row(0), row(1), row(2)};
}

// A B and A' B
template <class S> ENGRAM_INLINE Mat3<S> matmul(const Mat3<S>& A, const Mat3<S>& B) {
  return {mul(A, B.column(0)), mul(A, B.column(1)), mul(A, B.column(2))};
}
template <class S> ENGRAM_INLINE Mat3<S> matmul_transposed(const Mat3<S>& A, const Mat3<S>& B) {
  return {mul_transposed(A, B.column(0)), mul_transposed(A, B.column(1)), mul_transposed(A, B.column(2))};
}

// [a]x, so that [a]x b = a x b
template <class S> ENGRAM_INLINE Mat3<S> skew(const Vec3<S>& a) {
  const S zero = 0.0;
  return {{zero, a[2], -a[1]}, {-a[2], zero, a[0]}, {a[1], -a[0], zero}};
}

// Symmetric 3x3 as xx xy xz yy yz zz: y + A x
template <class S> ENGRAM_INLINE Vec3<S> mul_symmetric_add(const S* A, const Vec3<S>& x, const Vec3<S>& y) {
  return {madd(A[0], x[0], madd(A[1], x[1], madd(A[2], x[2], y[0]))), madd(A[1], x[0], madd(A[3], x[1], madd(A[4], x[2], y[1]))),
          madd(A[2], x[0], madd(A[4], x[1], madd(A[5], x[2], y[2])))};
}

// ---- spatial vectors ----

// Velocity, acceleration, or a Jacobian column: (u, w).
template <class S> struct Motion {
  Vec3<S> lin, ang;

  Motion() = default;
  Motion(const Motion&) = default;
  ENGRAM_INLINE Motion& operator=(const Motion& b) {
    lin = b.lin;
    ang = b.ang;
    return *this;
  }
  ENGRAM_INLINE static Motion zero() { return {Vec3<S>::Zero(), Vec3<S>::Zero()}; }
  ENGRAM_INLINE Motion& operator+=(const Motion& b) {
    lin += b.lin;
    ang += b.ang;
    return *this;
  }
  ENGRAM_INLINE friend Motion operator+(Motion a, const Motion& b) { return a += b; }
  ENGRAM_INLINE friend Motion operator-(const Motion& a, const Motion& b) { return {a.lin - b.lin, a.ang - b.ang}; }
  ENGRAM_INLINE friend Motion operator*(const Motion& a, S s) { return {a.lin * s, a.ang * s}; }
  // a s + b
  ENGRAM_INLINE friend Motion madd(const Motion& a, S s, const Motion& b) {
    return {madd(a.lin, s, b.lin), madd(a.ang, s, b.ang)};
  }
};

// Force or momentum: (f, n), n about the world origin.
template <class S> struct Force {
  Vec3<S> lin, ang;

  Force() = default;
  Force(const Force&) = default;
  ENGRAM_INLINE Force& operator=(const Force& b) {
    lin = b.lin;
    ang = b.ang;
    return *this;
  }
  ENGRAM_INLINE static Force zero() { return {Vec3<S>::Zero(), Vec3<S>::Zero()}; }
  ENGRAM_INLINE Force& operator+=(const Force& b) {
    lin += b.lin;
    ang += b.ang;
    return *this;
  }
  ENGRAM_INLINE friend Force operator+(Force a, const Force& b) { return a += b; }
  ENGRAM_INLINE friend Force operator-(const Force& a, const Force& b) { return {a.lin - b.lin, a.ang - b.ang}; }
  ENGRAM_INLINE friend Force operator*(const Force& a, S s) { return {a.lin * s, a.ang * s}; }
  ENGRAM_INLINE friend Force madd(const Force& a, S s, const Force& b) { return {madd(a.lin, s, b.lin), madd(a.ang, s, b.ang)}; }
};

// m . f (power)
template <class S> ENGRAM_INLINE S dot(const Motion<S>& m, const Force<S>& f) { return dot_add(m.lin, f.lin, dot(m.ang, f.ang)); }

// a x b = (w_a x u_b + u_a x w_b, w_a x w_b), and c + a x b
template <class S> ENGRAM_INLINE Motion<S> cross(const Motion<S>& a, const Motion<S>& b) {
  return {cross_add(a.ang, b.lin, cross(a.lin, b.ang)), cross(a.ang, b.ang)};
}
template <class S> ENGRAM_INLINE Motion<S> cross_add(const Motion<S>& a, const Motion<S>& b, const Motion<S>& c) {
  return {cross_add(a.ang, b.lin, cross_add(a.lin, b.ang, c.lin)), cross_add(a.ang, b.ang, c.ang)};
}

// m x* f = (w x f, w x n + u x f), and c + m x* f
template <class S> ENGRAM_INLINE Force<S> cross(const Motion<S>& m, const Force<S>& f) {
  return {cross(m.ang, f.lin), cross_add(m.ang, f.ang, cross(m.lin, f.lin))};
}
template <class S> ENGRAM_INLINE Force<S> cross_add(const Motion<S>& m, const Force<S>& f, const Force<S>& c) {
  return {cross_add(m.ang, f.lin, c.lin), cross_add(m.ang, f.ang, cross_add(m.lin, f.lin, c.ang))};
}

// ---- inertia ----

// Mass, first moment m c [kg m] and rotational inertia about the world origin [kg m^2] as xx xy xz yy yz zz.
template <class S> struct Inertia {
  S mass;
  Vec3<S> moment;
  S I[6];

  ENGRAM_INLINE Inertia& operator+=(const Inertia& b) {
    mass += b.mass;
    moment += b.moment;
    for (int i = 0; i < 6; ++i) I[i] += b.I[i];
    return *this;
  }
  // Y a = (m u + w x mc, I w + mc x u), and f + Y a
  ENGRAM_INLINE friend Force<S> operator*(const Inertia& Y, const Motion<S>& a) { return mul_add(Y, a, Force<S>::zero()); }
  ENGRAM_INLINE friend Force<S> mul_add(const Inertia& Y, const Motion<S>& a, const Force<S>& f) {
    return {cross_add(a.ang, Y.moment, madd(a.lin, Y.mass, f.lin)),
            cross_add(Y.moment, a.lin, mul_symmetric_add(Y.I, a.ang, f.ang))};
  }
};

// Inertia of a body with axes R_WJ and origin p_WJ; constants in its axes: `com`, and `inertia` about the com (xx xy xz yy yz zz).
//   I = R Ic R' + m (|c|^2 1 - c c')
template <class S> ENGRAM_INLINE Inertia<S> inertia_in_world(const Mat3<S>& R_WJ, const Vec3<S>& p_WJ, S mass, const Vec3<S>& com,
                                                             const S (&inertia)[6]) {
  const Vec3<S> c = mul_add(R_WJ, com, p_WJ), mc = c * mass;
  const Vec3<S> none = Vec3<S>::Zero();
  Vec3<S> r[3], T[3];  // rows of R and of R Ic
  for (int i = 0; i < 3; ++i) {
    r[i] = R_WJ.row_vector(i);
    T[i] = mul_symmetric_add(inertia, r[i], none);
  }
  const S zz = mc[2] * c[2];
  Inertia<S> Y;
  Y.mass = mass;
  Y.moment = mc;
  Y.I[0] = dot_add<S>(T[0], r[0], madd(mc[1], c[1], zz));
  Y.I[1] = dot_add<S>(T[0], r[1], -(mc[0] * c[1]));
  Y.I[2] = dot_add<S>(T[0], r[2], -(mc[0] * c[2]));
  Y.I[3] = dot_add<S>(T[1], r[1], madd(mc[0], c[0], zz));
  Y.I[4] = dot_add<S>(T[1], r[2], -(mc[1] * c[2]));
  Y.I[5] = dot_add<S>(T[2], r[2], madd(mc[0], c[0], mc[1] * c[1]));
  return Y;
}

}  // namespace engram
#endif  // CONTROLLER_RBD_RBD_SPATIAL_H_
