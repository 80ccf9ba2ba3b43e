// What a residual r of m rows costs: the weighted square of what activate() leaves of it.
//
//   Weighted   1/2 sum_i w_i r_i^2
//   Bounded    1/2 sum_i w_i e_i^2,   e_i = max(0, r_i - hi_i) + min(0, r_i - lo_i)      a quadratic barrier on lo <= r <= hi
//
//   Lagrangian the same of r_i + lambda_i / w_i: the augmented Lagrangian of lo <= r <= hi (an equality if lo = hi), up to a constant.
//              fddp_lagrangian.h moves lambda to the constraint's multiplier and w, the penalty, upward.
//
// Either way the slope of e is 0 or 1, so that the Gauss-Newton model is J' diag(w [slope]) (e, J).
#ifndef CONTROLLER_OCP_OCP_ACTIVATION_H_
#define CONTROLLER_OCP_OCP_ACTIVATION_H_

#include "controller/rbd/rbd_pack.h"

namespace engram {

template <int m> struct Weighted {
  template <class S> struct Param {
    S w[m];
  };
  // (r, w) <- (e, w [slope])
  template <class S> ENGRAM_INLINE static void activate(const Param<S>& p, S (&)[m], S (&w)[m]) {
    for (int i = 0; i < m; ++i) w[i] = p.w[i];
  }
};

template <int m> struct Bounded {
  template <class S> struct Param {
    S w[m], lo[m], hi[m];
  };
  template <class S> ENGRAM_INLINE static void activate(const Param<S>& p, S (&r)[m], S (&w)[m]) {
    for (int i = 0; i < m; ++i) {
      r[i] = max(r[i] - p.hi[i], S(0.0)) + min(r[i] - p.lo[i], S(0.0));
      w[i] = select(abs(r[i]) > S(0.0), p.w[i], S(0.0));
    }
  }
};

template <int m> struct Lagrangian {
  static constexpr bool kHasMultipliers = true;
  template <class S> struct Param {
    S w[m], lo[m], hi[m];  // penalty, 0 where there is no constraint; bounds of the residual
    S lambda[m];           // multiplier, positive at hi
  };
  template <class S> ENGRAM_INLINE static void activate(const Param<S>& p, S (&r)[m], S (&w)[m]) {
    for (int i = 0; i < m; ++i) {
      const S shifted = r[i] + p.lambda[i] / max(p.w[i], S(1e-300));
      r[i] = max(shifted - p.hi[i], S(0.0)) + min(shifted - p.lo[i], S(0.0));
      w[i] = select(abs(r[i]) > S(0.0), p.w[i], S(0.0));
      r[i] = select(p.w[i] > S(0.0), r[i], S(0.0));
    }
  }
};

// 1/2 sum_i w_i e_i^2
template <int m, class S> ENGRAM_INLINE S weighted_square(const S (&e)[m], const S (&w)[m]) {
  S c = 0.0;
  for (int i = 0; i < m; ++i) c = madd(w[i] * e[i], e[i], c);
  return S(0.5) * c;
}

}  // namespace engram
#endif  // CONTROLLER_OCP_OCP_ACTIVATION_H_
