// Regularization terms: state about a reference or within bounds about it, torque about zero or about gravity.
#ifndef CONTROLLER_OCP_OCP_REGULARIZATION_H_
#define CONTROLLER_OCP_OCP_REGULARIZATION_H_

#include "controller/ocp/ocp_activation.h"
#include "controller/ocp/ocp_view.h"
#include "controller/rbd/rbd_manifold.h"

namespace engram {

// r (2 nv) = x (-) x_ref
template <class R, class S> inline void state_residual(const S* x_ref, const KnotView<R, S>& k, S (&r)[2 * R::nv]) {
  rbd_difference<R>(x_ref, k.q, r);
  for (int i = 0; i < R::nv; ++i) r[R::nv + i] = k.v[i] - x_ref[R::nq + i];
}

// Adds the model of 1/2 sum_i w_i e_i^2 of a residual x (-) x_ref, or of what an activation leaves of it; returns the cost.
template <class R, class S>
inline S expand_state(const S* x_ref, const KnotView<R, S>& k, const S (&e)[2 * R::nv], const S (&weight)[2 * R::nv], ModelOf<R, S>& M) {
  using L = LayoutOf<R>;
  constexpr int base = kFreeBase<R> ? 6 : 0;
  S c = 0.0;
  for (int i = 0; i < 2 * R::nv; ++i) {
    const S we = weight[i] * e[i];
    c += we * e[i];
    if (i < base) continue;
    const int z = padded_index<L>(i);
    M.Lz[z] += we;
    M.Lzz[z][z] += weight[i];
  }
  if constexpr (base > 0) {  // d (q (-) q_ref) / d q = Jlog6 in the base block
    Mat<S, 6, 6> J0, J1;
    rbd_difference_jacobians(x_ref, k.q, J0, J1);
    S J[6][6], rb[6], w[6];
    for (int i = 0; i < 6; ++i) {
      for (int j = 0; j < 6; ++j) J[i][j] = J1(i, j);
      rb[i] = e[i];
      w[i] = weight[i];
    }
    constexpr int dofs[6] = {0, 1, 2, 3, 4, 5};
    add_gauss_newton(J, dofs, 6, rb, w, M);
  }
  return S(0.5) * c;
}

// 1/2 sum_i w_i (x (-) x_ref)_i^2
template <class R> struct StateTerm {
  static constexpr bool kNeedsGravity = false;
  template <class S> struct Param {
    S state_w[2 * R::nv];        // weights of dq [1/rad^2 or 1/m^2], dv
    S state_ref[R::nq + R::nv];  // x_ref = (q, v)
  };
  template <class S> static S cost(const Param<S>& p, const KnotView<R, S>& k) {
    S r[2 * R::nv], c = 0.0;
    state_residual(p.state_ref, k, r);
    for (int i = 0; i < 2 * R::nv; ++i) c += p.state_w[i] * r[i] * r[i];
    return S(0.5) * c;
  }
  template <class S> static S expand(const Param<S>& p, const KnotView<R, S>& k, ModelOf<R, S>& M) {
    S r[2 * R::nv];
    state_residual(p.state_ref, k, r);
    return expand_state(p.state_ref, k, r, p.state_w, M);
  }
};

// Barrier on lo <= x (-) x_ref <= hi.
template <class R> struct StateBoundTerm {
  static constexpr bool kNeedsGravity = false;
  using A = Bounded<2 * R::nv>;
  template <class S> struct Param {
    typename A::template Param<S> bound;  // w, lo, hi of (dq, dv)
    S bound_ref[R::nq + R::nv];           // x_ref = (q, v)
  };
  template <class S> static S cost(const Param<S>& p, const KnotView<R, S>& k) {
    S e[2 * R::nv], w[2 * R::nv];
    state_residual(p.bound_ref, k, e);
    A::activate(p.bound, e, w);
    return weighted_square(e, w);
  }
  template <class S> static S expand(const Param<S>& p, const KnotView<R, S>& k, ModelOf<R, S>& M) {
    S e[2 * R::nv], w[2 * R::nv];
    state_residual(p.bound_ref, k, e);
    A::activate(p.bound, e, w);
    return expand_state(p.bound_ref, k, e, w, M);
  }
};

// 1/2 w |u|^2, or 1/2 w |u - g(q)|^2 about the gravity torque.
template <class R, bool about_gravity> struct ControlTerm {
  static constexpr bool kNeedsGravity = about_gravity;
  static constexpr int first = R::nv - R::nu;  // first actuated dof
  template <class S> struct Param {
    S control_w;  // [1/(N m)^2]
  };
  template <class S> static S cost(const Param<S>& p, const KnotView<R, S>& k) {
    S c = 0.0;
    for (int i = 0; i < R::nu; ++i) {
      const S r = residual(k, i);
      c += r * r;
    }
    return S(0.5) * p.control_w * c;
  }
  template <class S> static S expand(const Param<S>& p, const KnotView<R, S>& k, ModelOf<R, S>& M) {
    using L = LayoutOf<R>;
    const S w = p.control_w;
    S c = 0.0;
    for (int i = 0; i < R::nu; ++i) {
      const S r = residual(k, i), wr = w * r;
      c += r * r;
      M.Lz[L::ou + i] += wr;
      M.Lzz[L::ou + i][L::ou + i] += w;
      if constexpr (about_gravity) {  // d r / d q = -dg/dq
        const auto dg = k.dg_dq->row(first + i);
        for (int a = 0; a < R::nv; ++a) {
          const S wJ = w * dg[a];
          M.Lz[a] -= wr * dg[a];
          M.Lzz[L::ou + i][a] -= wJ;
          for (int b = 0; b <= a; ++b) M.Lzz[a][b] += wJ * dg[b];
        }
      }
    }
    return S(0.5) * w * c;
  }

 private:
  template <class S> static S residual(const KnotView<R, S>& k, int i) {
    if constexpr (about_gravity) return k.u[i] - k.g[first + i];
    else return k.u[i];
  }
};

}  // namespace engram
#endif  // CONTROLLER_OCP_OCP_REGULARIZATION_H_
