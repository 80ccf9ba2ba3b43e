// Soft limits: quadratic barriers on joint position, joint velocity and torque. 1/2 w max(0, excess)^2 each.
#ifndef CONTROLLER_OCP_OCP_LIMITS_H_
#define CONTROLLER_OCP_OCP_LIMITS_H_

#include "controller/ocp/ocp_actuation.h"
#include "controller/ocp/ocp_view.h"

namespace engram {

template <class R> struct LimitTerm {
  static constexpr bool kNeedsGravity = false;
  static constexpr int base = kFreeBase<R> ? 6 : 0;  // a free base has no limits
  template <class S> struct Param {
    S limit_w_q, limit_w_v, limit_w_u;  // weights [1/rad^2, s^2/rad^2, 1/(N m)^2]
    S limit_margin_q;                   // the position barrier starts this far inside the limit [rad or m]
    S limit_margin_v;                   // the velocity barrier starts this share of the limit inside it
  };
  template <class S> static S cost(const Param<S>& p, const KnotView<R, S>& k) {
    S c = 0.0;
    visit(p, k, [&](int, S w, S e) { c += w * e * e; });
    return S(0.5) * c;
  }
  template <class S> static S expand(const Param<S>& p, const KnotView<R, S>& k, ModelOf<R, S>& M) {
    S c = 0.0;
    visit(p, k, [&](int z, S w, S e) {
      const S we = w * e;
      c += we * e;
      M.Lz[z] += we;
      M.Lzz[z][z] += select(abs(e) > S(0.0), w, S(0.0));
    });
    return S(0.5) * c;
  }

 private:
  // Calls f(z, weight, signed excess) for every limited coordinate; the excess is 0 within the limits.
  template <class S, class F> static void visit(const Param<S>& p, const KnotView<R, S>& k, F f) {
    using L = LayoutOf<R>;
    const auto excess = [](S a, S lo, S hi) { return max(a - hi, S(0.0)) + min(a - lo, S(0.0)); };
    for (int i = base; i < R::nv; ++i) {
      const int q = R::nq - R::nv + i;
      f(L::oq + i, p.limit_w_q, excess(k.q[q], S(R::q_lo[q]) + p.limit_margin_q, S(R::q_hi[q]) - p.limit_margin_q));
      const S v_edge = S(R::v_max[i]) * (S(1.0) - p.limit_margin_v);
      f(L::ov + i, p.limit_w_v, excess(k.v[i], -v_edge, v_edge));
    }
    using U = ControlBounds<R>;
    for (int i = 0; i < R::nu; ++i) f(L::ou + i, p.limit_w_u, excess(k.u[i], S(U::lo(i)), S(U::hi(i))));
  }
};

}  // namespace engram
#endif  // CONTROLLER_OCP_OCP_LIMITS_H_
