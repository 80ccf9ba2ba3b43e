// The warp: a remembered bow bent to the measured state and to a goal posture, and the motion along it.
#ifndef CONTROLLER_MEMORY_MEMORY_WARP_H_
#define CONTROLLER_MEMORY_MEMORY_WARP_H_

#include "controller/rbd/rbd_rnea.h"

namespace engram {

// Minimum-jerk blends of [0, 1]: s from 0 to 1 at rest at both ends, h from rest to rest with slope 1 at 0. Both quintic, held outside.
struct Blend {
  double s, h;
  explicit Blend(double tau) {
    const double r = tau < 0 ? 0 : tau > 1 ? 1 : tau, r3 = r * r * r;
    s = r3 * (10 + r * (-15 + r * 6));
    h = r + r3 * (-6 + r * (8 - 3 * r));
  }
};

// Bends a bow to new ends, in place: bow (n + 1 knots, deviation from the straight line between its own ends) -> path
//
//   q(t) = (1 - s) q0 + s q_end + T h v0 + bow(t),   s, h at t / T
//
// For a remembered motion q_m with bow = q_m - (1 - s) q_m(0) - s q_m(T) this is q_m + (1 - s) (q0 - q_m(0)) + s (q_end - q_m(T)),
// and the velocity v0 at the start, which a remembered motion from rest does not have, fades out.
//
//   x0   (nq + nv)  measured state
//   end  (nq)       posture to arrive at (lanes are guesses)
//   t    (n + 1)    knot times [s], t[0] = 0;  T: length of a remembered motion [s]
template <class R, class S, class Path>
void warp_bow(const double* x0, const S* end, int n, const double* t, double T, Path& path) {
  static_assert(R::nq == R::nv, "a free base needs the warp on its manifold");
  for (int i = 0; i < R::nq; ++i) path[0][i] = x0[i];  // to the last bit, though the table's bow is rounded to float
  for (int k = 1; k <= n; ++k) {
    const Blend blend(t[k] / T);
    for (int i = 0; i < R::nq; ++i) {
      path[k][i] += (1 - blend.s) * x0[i] + T * blend.h * x0[R::nq + i] + blend.s * end[i];
    }
  }
}

// The motion along a path, as the integrator of the problem (semi-implicit Euler) would produce it, gap-free:
//
//   v_{k+1} = (q_{k+1} - q_k) / dt_k,   a_k = (v_{k+1} - v_k) / dt_k,   u_k = inverse dynamics(q_k, v_k, a_k)
//
// from v_0 = v0; calls take(k, q_k, v_k, u_k) for every knot, u_k null at the last.
template <class R, class S, class Path, class Take>
void follow_path(const double* v0, int n, const double* t, const Path& q, RbdData<R, S>& d, Take take) {
  S v[R::nv], v_next[R::nv], a[R::nv], u[R::nv];
  for (int i = 0; i < R::nv; ++i) v[i] = v0[i];
  for (int k = 0; k < n; ++k) {
    const double rate = 1 / (t[k + 1] - t[k]);
    for (int i = 0; i < R::nv; ++i) {
      v_next[i] = (q[k + 1][i] - q[k][i]) * rate;
      a[i] = (v_next[i] - v[i]) * rate;
    }
    rbd_rnea<R>(q[k], v, a, d, u);
    take(k, q[k], v, u);
    for (int i = 0; i < R::nv; ++i) v[i] = v_next[i];
  }
  take(n, q[n], v, static_cast<const S*>(nullptr));
}

}  // namespace engram
#endif  // CONTROLLER_MEMORY_MEMORY_WARP_H_
