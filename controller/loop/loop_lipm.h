// The centre of mass that a linear inverted pendulum takes over a given centre of pressure, without falling.
//
//   c - (z / g) c'' = zmp      bounded: c(0) given, c = zmp at the far end
//
// With second differences this is a tridiagonal, diagonally dominant system, solved by Thomas' algorithm without pivots.
// Source: Kajita et al., Biped walking pattern generation by using preview control of zero-moment point (ICRA 2003); the boundary value
// form, Nishiwaki et al. (IROS 2002).
#ifndef CONTROLLER_LOOP_LOOP_LIPM_H_
#define CONTROLLER_LOOP_LOOP_LIPM_H_

namespace engram {

// One horizontal axis. zmp (n) [m] at instants dt [s] apart, c (n) [m]; height: z of the pendulum [m]; first: c[0]. n >= 2.
template <int n> void lipm_reference(double dt, double height, double first, const double (&zmp)[n], double (&c)[n]) {
  constexpr double kGravity = 9.81;
  const double k = height / (kGravity * dt * dt), diagonal = 1.0 + 2.0 * k;
  double upper[n];  // of the eliminated rows: c_i = rhs_i + upper_i c_{i+1}
  c[0] = first;
  upper[0] = 0.0;
  for (int i = 1; i < n - 1; ++i) {
    const double pivot = diagonal - k * upper[i - 1];
    upper[i] = k / pivot;
    c[i] = (zmp[i] + k * c[i - 1]) / pivot;
  }
  c[n - 1] = zmp[n - 1];
  for (int i = n - 2; i > 0; --i) c[i] += upper[i] * c[i + 1];
}

}  // namespace engram
#endif  // CONTROLLER_LOOP_LOOP_LIPM_H_
