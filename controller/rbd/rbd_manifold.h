// The configuration manifold: SE(3) x R^n for a free base, R^n without. Tangent of the base: twist in body axes, linear first.
//   q (+) dq = q exp(dq),   q1 (-) q0 = log(q0^-1 q1)
// Source: Sola, Deray, Atchuthan, A micro Lie theory (2018); Barfoot, State Estimation for Robotics (2017), chapter 7.
// Series near zero are picked by select: no branches on values.
#ifndef CONTROLLER_RBD_RBD_MANIFOLD_H_
#define CONTROLLER_RBD_RBD_MANIFOLD_H_

#include "controller/rbd/rbd_kinematics.h"

namespace engram {

// Below this theta^2 the series take over; their truncation and the closed forms' cancellation are both under 1e-12 there.
inline constexpr Real kSeriesBelow = 0.5;

// Coefficients of exp: a = sin(t)/t, b = (1 - cos t)/t^2, c = (t - sin t)/t^3.
template <class S> struct ExpCoefficients {
  S a, b, c;

  explicit ExpCoefficients(S theta2) {
    const auto small = theta2 < S(kSeriesBelow);
    const S t2 = select(small, S(1.0), theta2);  // keeps the closed forms finite where they are not used
    const S t = sqrt(t2);
    S st, ct;
    sincos(t, st, ct);
    a = select(small, polynomial(theta2, 1.0, -1.0 / 6, 1.0 / 120, -1.0 / 5040, 1.0 / 362880, -1.0 / 39916800, 1.0 / 6227020800),
               st / t);
    b = select(
        small,
        polynomial(theta2, 1.0 / 2, -1.0 / 24, 1.0 / 720, -1.0 / 40320, 1.0 / 3628800, -1.0 / 479001600, 1.0 / 87178291200),
        (1.0 - ct) / t2);
    c = select(small,
               polynomial(theta2, 1.0 / 6, -1.0 / 120, 1.0 / 5040, -1.0 / 362880, 1.0 / 39916800, -1.0 / 6227020800,
                          1.0 / 1307674368000),
               (t - st) / (t2 * t));
  }
};

// Coefficients of log: alpha = (t/2) cot(t/2), beta = (1 - alpha)/t^2, gamma = (d beta / d t)/t.
template <class S> struct LogCoefficients {
  S alpha, beta, gamma;

  explicit LogCoefficients(S theta2) {
    const auto small = theta2 < S(kSeriesBelow);
    const S t2 = select(small, S(1.0), theta2);
    const S t = sqrt(t2);
    S s, c;  // of t/2
    sincos(S(0.5) * t, s, c);
    const S closed_alpha = 0.5 * t * c / s;
    // Bernoulli series of x cot x
    beta = select(small,
                  polynomial(theta2, 1.0 / 12, 1.0 / 720, 1.0 / 30240, 1.0 / 1209600, 1.0 / 47900160, 691.0 / 1307674368000,
                             1.0 / 74724249600, 3617.0 / 10670622842880000),
                  (1.0 - closed_alpha) / t2);
    alpha = nmadd(beta, theta2, S(1.0));
    gamma = select(small,
                   polynomial(theta2, 2.0 / 720, 4.0 / 30240, 6.0 / 1209600, 8.0 / 47900160, 6910.0 / 1307674368000,
                              12.0 / 74724249600, 14 * 3617.0 / 10670622842880000),
                   (0.25 * t2 / (s * s) + closed_alpha - 2.0) / (t2 * t2));
  }
};

// s 1 + [h]x + l r': the shape of exp3 and of the Jacobians of exp3 and log3
template <class S> inline Mat3<S> scaled_identity_skew_outer(S s, const Vec3<S>& h, const Vec3<S>& l, const Vec3<S>& r) {
  Mat3<S> A;
  A << madd(l[0], r[0], s), msub(l[0], r[1], h[2]), madd(l[0], r[2], h[1]),  //
      madd(l[1], r[0], h[2]), madd(l[1], r[1], s), msub(l[1], r[2], h[0]),   //
      msub(l[2], r[0], h[1]), madd(l[2], r[1], h[0]), madd(l[2], r[2], s);
  return A;
}

// Rotation by the vector w [rad]: cos(t) 1 + a [w]x + b w w'
template <class S> inline Mat3<S> exp3(const Vec3<S>& w) {
  const ExpCoefficients<S> e(dot(w, w));
  return scaled_identity_skew_outer<S>(nmadd(e.b, dot(w, w), S(1.0)), w * e.a, w * e.b, w);
}

// Rotation vector of the quaternion (x y z w) of any positive norm: |w| <= pi.
template <class S> inline Vec3<S> log_of_quaternion(const S* quat) {
  const Vec3<S> v(quat[0], quat[1], quat[2]);
  S per_n;
  atan2_first_quadrant(sqrt(dot(v, v)), abs(quat[3]), per_n);
  return v * select(quat[3] < S(0.0), -2.0 * per_n, 2.0 * per_n);
}

// Quaternion (x y z w) of a rotation matrix, of norm 2 |largest component| (Shepperd's method: divides by nothing small).
template <class S> inline void quaternion_of(const Mat3<S>& R, S* quat) {
  const S xx = R(0, 0), yy = R(1, 1), zz = R(2, 2);
  const S x_w = R(2, 1) - R(1, 2), y_w = R(0, 2) - R(2, 0), z_w = R(1, 0) - R(0, 1);  // 4 x w ...
  const S x_y = R(1, 0) + R(0, 1), x_z = R(0, 2) + R(2, 0), y_z = R(2, 1) + R(1, 2);  // 4 x y ...
  const S w_w = 1.0 + (xx + yy + zz), x_x = 1.0 + (xx - yy - zz), y_y = 1.0 + (yy - xx - zz), z_z = 1.0 + (zz - xx - yy);
  // the row of 4 quat quat' with the largest diagonal entry is the best conditioned
  const S wx = max(w_w, x_x), yz = max(y_y, z_z);
  const auto pick = [&](S w, S x, S y, S z) { return select(wx > yz, select(w_w > x_x, w, x), select(y_y > z_z, y, z)); };
  quat[0] = pick(x_w, x_x, x_y, x_z);
  quat[1] = pick(y_w, x_y, y_y, y_z);
  quat[2] = pick(z_w, x_z, y_z, z_z);
  quat[3] = pick(w_w, x_w, y_w, z_w);
}

// Rotation vector of R, |w| <= pi.
template <class S> inline Vec3<S> log3(const Mat3<S>& R) {
  S quat[4];
  quaternion_of(R, quat);
  return log_of_quaternion(quat);
}

// d log3(R exp3(e)) / d e at e = 0 for w = log3(R):  alpha 1 + [w]x/2 + beta w w'
template <class S> inline Mat3<S> jlog3(const Vec3<S>& w, const LogCoefficients<S>& l) {
  return scaled_identity_skew_outer<S>(l.alpha, w * S(0.5), w * l.beta, w);
}
template <class S> inline Mat3<S> jlog3(const Vec3<S>& w) { return jlog3(w, LogCoefficients<S>(dot(w, w))); }

// d exp3(w + e) = exp3(w) exp3(J e):  J = a 1 - b [w]x + c w w'
template <class S> inline Mat3<S> jexp3(const Vec3<S>& w) {
  const ExpCoefficients<S> e(dot(w, w));
  return scaled_identity_skew_outer<S>(e.a, w * -e.b, w * e.c, w);
}

// Placement (R, p) reached by the unit twist m: p = u + b w x u + c w x (w x u).
template <class S> inline Vec3<S> exp6_position(const Motion<S>& m) {
  const ExpCoefficients<S> e(dot(m.ang, m.ang));
  const Vec3<S> wu = cross(m.ang, m.lin);
  return madd<S>(cross(m.ang, wu), e.c, madd(wu, e.b, m.lin));
}
template <class S> inline void exp6(const Motion<S>& m, Mat3<S>& R, Vec3<S>& p) {
  R = exp3(m.ang);
  p = exp6_position(m);
}

// Twist that reaches (R, p) with w = log3(R):  u = alpha p - w x p / 2 + beta (w . p) w
template <class S> inline Vec3<S> log6_linear(const Vec3<S>& w, const Vec3<S>& p) {
  const LogCoefficients<S> l(dot(w, w));
  return cross_add<S>(w * S(-0.5), p, madd<S>(w, l.beta * dot(w, p), p * l.alpha));
}
template <class S> inline Motion<S> log6(const Mat3<S>& R, const Vec3<S>& p) {
  const Vec3<S> w = log3(R);
  return {log6_linear(w, p), w};
}

// Blocks of d log6(M exp6(e)) / d e = [A, C A; 0, A] at e = 0, for M = (R, p), w = log3(R):
//   A = jlog3(w),  C = ((gamma w.p) w - (theta^2 gamma + 2 beta) p) w' + beta w p' + beta (w.p) 1 + [p]x/2
template <class S> inline void jlog6_blocks(const Vec3<S>& w, const Vec3<S>& p, Mat3<S>& A, Mat3<S>& C) {
  const S theta2 = dot(w, w), wp = dot(w, p);
  const LogCoefficients<S> l(theta2);
  A = jlog3(w, l);
  const Vec3<S> left = madd<S>(w, l.gamma * wp, p * -madd(theta2, l.gamma, 2.0 * l.beta)), bw = w * l.beta;
  C = scaled_identity_skew_outer<S>(l.beta * wp, p * S(0.5), bw, p);
  for (int j = 0; j < 3; ++j) C.col(j) = madd<S>(left, w[j], C.col(j));
}

template <class S> inline Mat<S, 6, 6> block_triangular(const Mat3<S>& A, const Mat3<S>& B) {
  Mat<S, 6, 6> J;
  J << A, B, Mat3<S>::Zero(), A;
  return J;
}

// d log6(M exp6(e)) / d e at e = 0, for M = (R, p) with w = log3(R).
template <class S> inline Mat<S, 6, 6> jlog6(const Vec3<S>& w, const Vec3<S>& p) {
  Mat3<S> A, C;
  jlog6_blocks(w, p, A, C);
  return block_triangular<S>(A, matmul(C, A));
}

// d exp6(m + e) = exp6(m) exp6(J e); the inverse of jlog6: [A, C A; 0, A]^-1 = [A^-1, -A^-1 C; 0, A^-1]
template <class S> inline Mat<S, 6, 6> jexp6(const Motion<S>& m) {
  Mat3<S> A, C;
  jlog6_blocks(m.ang, exp6_position(m), A, C);
  const Mat3<S> A_inv = jexp3(m.ang);
  return block_triangular<S>(A_inv, -matmul(A_inv, C));
}

// Carries a twist in the axes of A to the axes of B, for B = (R, p) in A: [R', -R' [p]x; 0, R'].
template <class S> inline Mat<S, 6, 6> inverse_action(const Mat3<S>& R, const Vec3<S>& p) {
  const Mat3<S> Rt = R.transpose();
  return block_triangular<S>(Rt, matmul<S>(Rt, skew<S>(-p)));
}

// q_out (nq) = q (+) dq. In place is allowed. The quaternion comes out normalized, on the side of the old one.
template <class R, class S> inline void rbd_integrate(const S* q, const S* dq, S* q_out) {
  constexpr int nb = has_free_base<R>() ? 1 : 0;
  if constexpr (nb) {
    const Motion<S> m = {{dq[0], dq[1], dq[2]}, {dq[3], dq[4], dq[5]}};
    const Vec3<S> p = mul_add(rotation_of(q + 3), exp6_position(m), Vec3<S>(q[0], q[1], q[2]));
    // e = (w sin(t/2)/t, cos(t/2))
    const S quarter = 0.25 * dot(m.ang, m.ang);
    const ExpCoefficients<S> half(quarter);
    const Vec3<S> ev = m.ang * (0.5 * half.a);
    const S ew = nmadd(quarter, half.b, S(1.0));
    const Vec3<S> v(q[3], q[4], q[5]);
    const S w = q[6];
    const Vec3<S> ov = cross_add<S>(v, ev, madd<S>(ev, w, v * ew));
    const S ow = msub(w, ew, dot(v, ev));
    const S scale = 1.0 / sqrt(dot_add(ov, ov, ow * ow));
    const S side = select(ew < S(0.0), -scale, scale);
    for (int i = 0; i < 3; ++i) {
      q_out[i] = p[i];
      q_out[3 + i] = ov[i] * side;
    }
    q_out[6] = ow * side;
  }
  for (int i = 7 * nb; i < R::nq; ++i) q_out[i] = q[i] + dq[i - nb];
}

// Base placement of q1 seen from q0: quaternion and position.
template <class S> inline void base_difference(const S* q0, const S* q1, S* quat, Vec3<S>& p) {
  p = mul_transposed<S>(rotation_of(q0 + 3), Vec3<S>(q1[0] - q0[0], q1[1] - q0[1], q1[2] - q0[2]));
  const Vec3<S> a(-q0[3], -q0[4], -q0[5]), b(q1[3], q1[4], q1[5]);
  const Vec3<S> v = cross_add<S>(a, b, madd<S>(b, q0[6], a * q1[6]));
  for (int i = 0; i < 3; ++i) quat[i] = v[i];
  quat[3] = msub(q0[6], q1[6], dot(a, b));
}

// dq (nv) = q1 (-) q0, so that q0 (+) dq = q1.
template <class R, class S> inline void rbd_difference(const S* q0, const S* q1, S* dq) {
  constexpr int nb = has_free_base<R>() ? 1 : 0;
  if constexpr (nb) {
    S quat[4];
    Vec3<S> p;
    base_difference(q0, q1, quat, p);
    const Vec3<S> w = log_of_quaternion(quat), u = log6_linear(w, p);
    for (int i = 0; i < 3; ++i) {
      dq[i] = u[i];
      dq[3 + i] = w[i];
    }
  }
  for (int i = 7 * nb; i < R::nq; ++i) dq[i - nb] = q1[i] - q0[i];
}

// Base blocks (6 x 6) of the Jacobians of q (+) dq for a free base; the rest of both is the identity.
//   E = d (q (+) dq) / d q = Ad(exp(dq))^-1,   G = d (q (+) dq) / d dq = jexp6(dq)
template <class S> inline void rbd_integrate_jacobians(const S* dq, Mat<S, 6, 6>& E, Mat<S, 6, 6>& G) {
  const Motion<S> m = {{dq[0], dq[1], dq[2]}, {dq[3], dq[4], dq[5]}};
  Mat3<S> R;
  Vec3<S> p;
  exp6(m, R, p);
  E = inverse_action(R, p);
  G = jexp6(m);
}

// Base blocks (6 x 6) of the Jacobians of q1 (-) q0 for a free base; the rest is minus the identity and the identity.
//   J1 = d (q1 (-) q0) / d q1 = jlog6(M),   J0 = d (q1 (-) q0) / d q0 = -jlog6(M) Ad(M)^-1,   M = q0^-1 q1
template <class S> inline void rbd_difference_jacobians(const S* q0, const S* q1, Mat<S, 6, 6>& J0, Mat<S, 6, 6>& J1) {
  S quat[4];
  Vec3<S> p;
  base_difference(q0, q1, quat, p);
  J1 = jlog6(log_of_quaternion(quat), p);
  const Mat<S, 6, 6> X = inverse_action(rotation_of(quat), p);
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < 6; ++j) {
      S sum = J1(i, 0) * X(0, j);
      for (int k = 1; k < 6; ++k) sum = madd(J1(i, k), X(k, j), sum);
      J0(i, j) = -sum;
    }
  }
}

}  // namespace engram
#endif  // CONTROLLER_RBD_RBD_MANIFOLD_H_
