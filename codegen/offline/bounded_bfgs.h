// Minimization within bounds by BFGS with projected steps; in lanes, one search per lane. The refiner of the studies.
#ifndef CODEGEN_OFFLINE_BOUNDED_BFGS_H_
#define CODEGEN_OFFLINE_BOUNDED_BFGS_H_

#include "controller/rbd/rbd_pack.h"

#include <algorithm>
#include <limits>
#include <vector>

namespace engram::offline {

// Minimizes f over the variables first .. d - 1 of x (d), within lo and hi, from x in place; returns f there. f(x, gradient) gives value
// and gradient. At most `evaluations` of them, one per step that is tried; no more once every lane is at `enough` or below.
//   step = alpha P(-H g),   P: variables at a bound that the gradient pushes through it stay, the others stop at it
// H follows BFGS where s'y > 0, starts as the squares of the ranges scaled to a first step of a tenth, and starts again where the
// search along -H g has shrunk to nothing. Armijo's condition with halving; every lane for itself.
// Source: Nocedal & Wright, Numerical Optimization (2006), chapters 6 and 16.7.
template <class S, class F>
S bounded_bfgs(const F& f, const std::vector<double>& lo, const std::vector<double>& hi, int first, int evaluations, double enough, S* x) {
  constexpr double kArmijo = 1e-4, kShortest = 1e-4, kCurvature = 1e-12, kDone = 1e-9;
  const int d = int(lo.size()), n = d - first;
  std::vector<S> H(n * n), g(d), x_try(x, x + d), g_try(d), dir(n), s(n), y(n), Hy(n);
  const auto restart = [&](auto mask) {  // H = first step of a tenth of the range along the scaled gradient, where mask
    S norm2 = 0.0;
    for (int i = 0; i < n; ++i) {
      const S gi = g[first + i] * (hi[first + i] - lo[first + i]);
      norm2 += gi * gi;
    }
    const S length = 0.1 / max(sqrt(norm2), S(1e-12));
    for (int i = 0; i < n; ++i) {
      const double range = hi[first + i] - lo[first + i];
      for (int j = 0; j < n; ++j) H[i * n + j] = select(mask, i == j ? S(length * (range * range)) : S(0.0), H[i * n + j]);
    }
  };

  for (int i = first; i < d; ++i) x[i] = x_try[i] = min(max(x[i], S(lo[i])), S(hi[i]));
  S cost = f(x, g.data());
  const S one = 1.0, zero = 0.0;
  const auto all = one > zero;
  std::fill(H.begin(), H.end(), zero);
  restart(all);
  S alpha = 1.0, fresh = 1.0;
  for (int e = 1; e < evaluations; ++e) {
    S slope = 0.0;
    for (int i = 0; i < n; ++i) {
      const int k = first + i;
      const auto held = ((x[k] <= S(lo[k])) & (g[k] > zero)) | ((x[k] >= S(hi[k])) & (g[k] < zero));
      s[i] = select(held, zero, g[k]);
    }
    for (int i = 0; i < n; ++i) {
      S sum = 0.0;
      for (int j = 0; j < n; ++j) sum = madd(H[i * n + j], s[j], sum);
      dir[i] = select((s[i] > zero) | (s[i] < zero), -sum, zero);
      slope = madd(s[i], dir[i], slope);
    }
    S predicted = 0.0;
    for (int i = 0; i < n; ++i) {
      const int k = first + i;
      x_try[k] = min(max(madd(alpha, dir[i], x[k]), S(lo[k])), S(hi[k]));
      s[i] = x_try[k] - x[k];
      predicted = madd(g[k], s[i], predicted);
    }
    const S cost_try = f(x_try.data(), g_try.data());
    const auto accept = (cost_try <= madd(S(kArmijo), predicted, cost)) & (predicted < zero);

    S sy = 0.0, yHy = 0.0, ss = 0.0, yy = 0.0;
    for (int i = 0; i < n; ++i) {
      y[i] = g_try[first + i] - g[first + i];
      sy = madd(s[i], y[i], sy);
      ss = madd(s[i], s[i], ss);
      yy = madd(y[i], y[i], yy);
    }
    const auto curved = accept & (sy * sy > kCurvature * ss * yy) & (sy > zero);
    for (int i = 0; i < n; ++i) {
      S sum = 0.0;
      for (int j = 0; j < n; ++j) sum = madd(H[i * n + j], y[j], sum);
      Hy[i] = sum;
      yHy = madd(y[i], sum, yHy);
    }
    const S rescale = select(curved & (fresh > zero), sy / yHy, one);  // of the first H, to the curvature found
    const S rho = select(curved, one / sy, zero), both = rho * madd(rho * rescale, yHy, one);
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n; ++j)
        H[i * n + j] = rescale * (H[i * n + j] - rho * (s[i] * Hy[j] + Hy[i] * s[j])) + both * s[i] * s[j];
    fresh = select(curved, zero, fresh);

    S change = 0.0;
    for (int k = first; k < d; ++k) {
      x[k] = select(accept, x_try[k], x[k]);
      g[k] = select(accept, g_try[k], g[k]);
    }
    cost = select(accept, cost_try, cost);
    alpha = select(accept, one, 0.4 * alpha);
    const auto stuck = alpha < S(kShortest);
    fresh = select(stuck, one, fresh);
    restart(stuck);
    alpha = select(stuck, one, alpha);
    bool done = true;
    for (int l = 0; l < lanes_of<S>; ++l) done &= -lane(slope, l) < kDone || lane(cost, l) <= enough;
    if (done) break;
    (void)change;
  }
  return cost;
}

}  // namespace engram::offline
#endif  // CODEGEN_OFFLINE_BOUNDED_BFGS_H_
