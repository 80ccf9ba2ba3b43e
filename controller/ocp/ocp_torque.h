// Term on the controls about a reference, each weighed by itself.
#ifndef CONTROLLER_OCP_OCP_TORQUE_H_
#define CONTROLLER_OCP_OCP_TORQUE_H_

#include "controller/ocp/ocp_view.h"

namespace engram {

// 1/2 sum_i w_i (u_i - u*_i)^2
template <class R> struct TorqueTerm {
  static constexpr bool kNeedsGravity = false;
  template <class S> struct Param {
    S torque_w[R::nu];    // [1/(N m)^2]
    S torque_ref[R::nu];  // u* [N m]
  };
  template <class S> static S cost(const Param<S>& p, const KnotView<R, S>& k) {
    S c = 0.0;
    for (int i = 0; i < R::nu; ++i) {
      const S r = k.u[i] - p.torque_ref[i];
      c += p.torque_w[i] * r * r;
    }
    return S(0.5) * c;
  }
  template <class S> static S expand(const Param<S>& p, const KnotView<R, S>& k, ModelOf<R, S>& M) {
    using L = LayoutOf<R>;
    S c = 0.0;
    for (int i = 0; i < R::nu; ++i) {
      const S r = k.u[i] - p.torque_ref[i], wr = p.torque_w[i] * r;
      c += wr * r;
      M.Lz[L::ou + i] += wr;
      M.Lzz[L::ou + i][L::ou + i] += p.torque_w[i];
    }
    return S(0.5) * c;
  }
};

}  // namespace engram
#endif  // CONTROLLER_OCP_OCP_TORQUE_H_
