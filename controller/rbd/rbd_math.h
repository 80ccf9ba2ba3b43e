// Branch-free sine, cosine and arc tangent over a scalar S (Real or Pack): the same operations in every lane.
#ifndef CONTROLLER_RBD_RBD_MATH_H_
#define CONTROLLER_RBD_RBD_MATH_H_

#include "controller/rbd/rbd_pack.h"

namespace engram {

// c + x (c1 + x (c2 + ...)): Horner's rule, lowest coefficient first
template <class S> ENGRAM_INLINE S polynomial(S, double c) { return S(c); }
template <class S, class... C> ENGRAM_INLINE S polynomial(S x, double c, C... higher) {
  return madd(x, polynomial(x, higher...), S(c));
}

// s = sin a, c = cos a [rad] within 1 ulp for |a| < 1e4 (absolute 1e-21 near their zeros).
// Cody-Waite: a = n pi/2 + r + low with pi/2 in two parts (33 and 53 bits), |r| <= pi/4; then the minimax polynomials of fdlibm
// (Sun, 1993), corrected to first order in low. In single precision pi/2 is in two parts of 12 and 24 bits, for |a| < 1e3.
template <class S> ENGRAM_INLINE void sincos(S a, S& s, S& c) {
  constexpr bool kDouble = sizeof(Real) == sizeof(double);
  constexpr Real kRound = kDouble ? 0x1.8p52 : 0x1.8p23;  // adding it leaves the nearest integer in the low bits
  constexpr Real kHigh = kDouble ? 1.57079632673412561417 : 0x1.922p0;                            // the first bits of pi/2
  constexpr Real kLow = kDouble ? 6.07710050650619224932e-11 : 1.57079632679489661923 - 0x1.922p0;  // what they lack
  constexpr int kSign = 8 * sizeof(Real) - 2;                                                       // bit 1 to the sign
  const S shifted = madd(a, S(2.0 / 3.14159265358979323846), S(kRound));
  const S n = shifted - kRound;
  const S exact = nmadd(n, S(kHigh), a);
  const S r = nmadd(n, S(kLow), exact);
  const S low = nmadd(n, S(kLow), exact - r);
  const S z = r * r;
  const S sin_p = polynomial(z, -1.66666666666666324348e-01, 8.33333333332248946124e-03, -1.98412698298579493134e-04,
                             2.75573137070700676789e-06, -2.50507602534068634195e-08, 1.58969099521155010221e-10);
  const S cos_p = polynomial(z, 4.16666666666666019037e-02, -1.38888888888741095749e-03, 2.48015872894767294178e-05,
                             -2.75573143513906633035e-07, 2.08757232129817482790e-09, -1.13596475577881948265e-11);
  // 1 - z/2 rounds; what it lost is (1 - w) - z/2
  const S w = nmadd(S(0.5), z, S(1.0));
  const S sin_r = r + madd(r * z, sin_p, low * w);
  const S cos_r = w + madd(z * z, cos_p, nmadd(r, low, nmadd(S(0.5), z, 1.0 - w)));
  // quadrant n mod 4: sine and cosine change places when odd; signs from bit 1 of n and n + 1
  const auto quadrant = to_bits(shifted);
  const auto sin_bits = to_bits(sin_r), cos_bits = to_bits(cos_r);
  const auto swap = (sin_bits ^ cos_bits) & -(quadrant & 1);
  s = from_bits(sin_bits ^ swap ^ ((quadrant & 2) << kSign));
  c = from_bits(cos_bits ^ swap ^ (((quadrant + 1) & 2) << kSign));
}

// Angle in [0, pi/2] of the point (x, y) in the first quadrant, x + y > 0, and its ratio to y (finite for y -> 0) through `per_y`.
// Reduction to |t| <= 0.66 and the rational approximation of Cephes (Moshier, 1989), within 2 ulp.
template <class S> ENGRAM_INLINE S atan2_first_quadrant(S y, S x, S& per_y) {
  constexpr Real kQuarterPi = 0.785398163397448309616, kHalfPi = 1.57079632679489661923;
  const auto near_y = y > x * 2.41421356237309504880, between = y > x * 0.66;
  const S numerator = select(near_y, -x, select(between, y - x, y));
  const S denominator = select(near_y, y, select(between, y + x, x));
  const S offset = select(near_y, S(kHalfPi), select(between, S(kQuarterPi), S(0.0)));
  const S t = numerator / denominator;
  const S z = t * t;
  const S P = polynomial(z, -6.485021904942025371773e1, -1.228866684490136173410e2, -7.500855792314704667340e1,
                         -1.615753718733365076637e1, -8.750608600031904122785e-1);
  const S Q = polynomial(z, 1.945506571482613964425e2, 4.853903996359136964868e2, 4.328810604912902668951e2,
                         1.650270098316988542046e2, 2.485846490142306297962e1, 1.0);
  const S ratio = madd(z, P / Q, S(1.0));
  const S angle = madd(t, ratio, offset);
  per_y = select(between, angle, ratio) / select(between, y, x);
  return angle;
}

}  // namespace engram
#endif  // CONTROLLER_RBD_RBD_MATH_H_
