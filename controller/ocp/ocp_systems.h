// The small systems of the literature, each one formula: pendulum, unicycle, bicopter (thesis 5.3, Figure 5.2).
#ifndef CONTROLLER_OCP_OCP_SYSTEMS_H_
#define CONTROLLER_OCP_OCP_SYSTEMS_H_

#include "controller/ocp/ocp_analytic.h"

namespace engram {

// A point mass on a massless rod, torque u [N m] at the pivot. q: angle from upright [rad].
//   m l^2 q'' = m g l sin q - b q' + u
struct Pendulum {
  static constexpr int n = 1, nu = 1;
  static constexpr double u_lo[nu] = {-5.0}, u_hi[nu] = {5.0};
  static constexpr double m = 1.0, l = 1.0, g = 9.81, b = 0.1;  // kg, m, m/s^2, N m s/rad
  template <class T> static void step(const T& dt, const T* q, const T* v, const T* u, T* v_next) {
    T s, c;
    sincos(q[0], s, c);
    v_next[0] = v[0] + dt * (T(g / l) * s + T(1.0 / (m * l * l)) * (u[0] - T(b) * v[0]));
  }
};

// A point that rolls where it points. q: x, y [m], heading [rad]; u: speed [m/s], turning rate [rad/s]. Of first order.
//   x' = u0 cos h,  y' = u0 sin h,  h' = u1
struct Unicycle {
  static constexpr int n = 3, nu = 2;
  static constexpr double u_lo[nu] = {-2.0, -4.0}, u_hi[nu] = {2.0, 4.0};
  template <class T> static void step(const T&, const T* q, const T*, const T* u, T* v_next) {
    T s, c;
    sincos(q[2], s, c);
    v_next[0] = u[0] * c;
    v_next[1] = u[0] * s;
    v_next[2] = u[1];
  }
};

// A planar craft with two propellers that only push. q: x, z [m], pitch [rad] (positive turns x towards z); u: thrusts [N] at +l, -l.
//   m x'' = -(u0 + u1) sin p,  m z'' = (u0 + u1) cos p - m g,  I p'' = l (u0 - u1)
struct Bicopter {
  static constexpr int n = 3, nu = 2;
  static constexpr double u_lo[nu] = {0.0, 0.0}, u_hi[nu] = {25.0, 25.0};
  static constexpr double m = 2.5, l = 0.5, I = 1.2, g = 9.81;  // kg, m, kg m^2, m/s^2
  static constexpr double hover = 0.5 * m * g;                  // N, each thrust
  template <class T> static void step(const T& dt, const T* q, const T* v, const T* u, T* v_next) {
    T s, c;
    sincos(q[2], s, c);
    const T lift = T(1.0 / m) * (u[0] + u[1]);
    v_next[0] = v[0] - dt * lift * s;
    v_next[1] = v[1] + dt * (lift * c - T(g));
    v_next[2] = v[2] + dt * T(l / I) * (u[0] - u[1]);
  }
};

}  // namespace engram
#endif  // CONTROLLER_OCP_OCP_SYSTEMS_H_
