// Term on the centre of mass.
#ifndef CONTROLLER_OCP_OCP_COM_H_
#define CONTROLLER_OCP_OCP_COM_H_

#include "controller/ocp/ocp_view.h"
#include "controller/rbd/rbd_com.h"

namespace engram {

// 1/2 sum_i w_i (c - c*)_i^2. Needs the moments of the subtrees in k.d.
template <class R> struct ComTerm {
  static constexpr bool kNeedsGravity = false;
  template <class S> struct Param {
    S com_w[3];    // weights [1/m^2], world axes
    S com_ref[3];  // c* [m], world axes
  };

  template <class S> static S cost(const Param<S>& p, const KnotView<R, S>& k) {
    const Vec3<S> r = rbd_com<R>(k.d) - Vec3<S>(p.com_ref[0], p.com_ref[1], p.com_ref[2]);
    return S(0.5) * dot(r, weighted(p, r));
  }

  template <class S> static S expand(const Param<S>& p, const KnotView<R, S>& k, ModelOf<R, S>& M) {
    const Vec3<S> r = rbd_com<R>(k.d) - Vec3<S>(p.com_ref[0], p.com_ref[1], p.com_ref[2]);
    Vec3<S> J[R::nv];
    for (int a = 0; a < R::nv; ++a) {
      J[a] = rbd_com_column<R>(k.d, a);
      const Vec3<S> wJ = weighted(p, J[a]);
      M.Lz[a] += dot(wJ, r);
      for (int b = 0; b <= a; ++b) M.Lzz[a][b] += dot(wJ, J[b]);
    }
    return S(0.5) * dot(r, weighted(p, r));
  }

 private:
  template <class S> static Vec3<S> weighted(const Param<S>& p, const Vec3<S>& r) {
    return {p.com_w[0] * r[0], p.com_w[1] * r[1], p.com_w[2] * r[2]};
  }
};

}  // namespace engram
#endif  // CONTROLLER_OCP_OCP_COM_H_
