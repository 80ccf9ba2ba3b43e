// Controls within their box: the sweep's minimization over du by projected Newton (Tassa, Mansard, Todorov, ICRA 2014).
//
//   minimize 1/2 d' Quu d + Qu' d   subject to   u_lo <= u + d <= u_hi
//
// Coordinates at a bound whose gradient points outward are clamped: their rows and columns of Quu become the identity and their
// rows of Qux zero, so that the one Cholesky factor and the one pair of solves of the sweep also serve the bounded case.
#ifndef CONTROLLER_FDDP_FDDP_BOX_H_
#define CONTROLLER_FDDP_FDDP_BOX_H_

#include "controller/fddp/fddp.h"
#include "controller/fddp/fddp_kernels.h"

#include <cstring>

namespace engram {

inline constexpr int kBoxIterations = 20;   // a Newton step per change of the clamped set; nu changes are the usual worst case
inline constexpr int kBoxStepLengths = 10;
inline constexpr Real kBoxArmijo = 0.1;
inline constexpr Real kBoxZero = 1e-12;     // free gradient, relative to the first one

// Solves for k = -d at control u; leaves the factor of the clamped Quu in w.Luu and inv, and clears the clamped rows of w.Y.
// False if the free part of Quu is not positive definite.
template <class P, int N> bool fddp_box(const Real* u, FddpWork<P, N>& w, Real* inv, Real* k) {
  using L = typename P::Layout;
  constexpr int nu = P::nu, nup = L::nup, ou = L::ou;
  const auto H = [&](int i, int j) { return i >= j ? w.Q[ou + i][ou + j] : w.Q[ou + j][ou + i]; };
  const Real* const g = w.Qz + ou;
  Real lo[nu], hi[nu], d[nu], grad[nu], step[nu], trial[nu];
  bool clamped[nu];
  for (int i = 0; i < nu; ++i) {
    lo[i] = P::u_lo(i) - u[i];
    hi[i] = P::u_hi(i) - u[i];
    d[i] = lo[i] > 0.0 ? lo[i] : hi[i] < 0.0 ? hi[i] : 0.0;
  }
  const auto value = [&](const Real* p, Real* gradient) {      // 1/2 p' H p + g' p, gradient H p + g
    Real v = 0.0;
    for (int i = 0; i < nu; ++i) {
      Real Hp = 0.0;
      for (int j = 0; j < nu; ++j) Hp += H(i, j) * p[j];
      v += (0.5 * Hp + g[i]) * p[i];
      if (gradient) gradient[i] = Hp + g[i];
    }
    return v;
  };

  Real v = value(d, grad), first = 0.0;
  for (int iteration = 0;; ++iteration) {
    Real free_gradient = 0.0;
    for (int i = 0; i < nu; ++i) {
      clamped[i] = (d[i] <= lo[i] && grad[i] > 0.0) || (d[i] >= hi[i] && grad[i] < 0.0);
      if (!clamped[i]) free_gradient += grad[i] * grad[i];
    }
    for (int i = 0; i < nu; ++i)  // factor of the clamped Hessian
      for (int j = 0; j <= i; ++j) w.Luu[i][j] = clamped[i] || clamped[j] ? (i == j ? 1.0 : 0.0) : H(i, j);
    if (!kernel::cholesky<nu>(&w.Luu[0][0], nup, inv)) return false;
    if (iteration == 0) first = free_gradient;
    if (free_gradient <= kBoxZero * kBoxZero * first || iteration == kBoxIterations) break;

    for (int i = 0; i < nu; ++i) {  // Newton step of the free coordinates
      step[i] = clamped[i] ? 0.0 : -grad[i];
      for (int j = 0; j < i; ++j) step[i] -= w.Luu[i][j] * step[j];
      step[i] *= inv[i];
    }
    for (int i = nu - 1; i >= 0; --i) {
      for (int j = i + 1; j < nu; ++j) step[i] -= w.Luu[j][i] * step[j];
      step[i] *= inv[i];
    }
    Real alpha = 1.0;
    bool moved = false;
    for (int trial_count = 0; trial_count < kBoxStepLengths && !moved; ++trial_count, alpha *= 0.5) {
      Real slope = 0.0;
      for (int i = 0; i < nu; ++i) {
        const Real t = d[i] + alpha * step[i];
        trial[i] = t < lo[i] ? lo[i] : t > hi[i] ? hi[i] : t;
        slope += grad[i] * (trial[i] - d[i]);
      }
      moved = slope < 0.0 && value(trial, nullptr) - v <= kBoxArmijo * slope;
    }
    if (!moved) break;
    std::memcpy(d, trial, sizeof(d));
    v = value(d, grad);
  }
  for (int i = 0; i < nu; ++i) {
    k[i] = -d[i];
    if (clamped[i]) std::memset(w.Y[i], 0, sizeof(w.Y[i]));
  }
  return true;
}

}  // namespace engram
#endif  // CONTROLLER_FDDP_FDDP_BOX_H_
