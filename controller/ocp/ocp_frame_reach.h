// A frame that is drawn to a point by a bounded force: what is far away shall not pull a robot off its feet.
//
//   w d^2 (s - 1),   s = sqrt(1 + |r|^2 / d^2),   r = p_WF - p*       (pseudo-Huber)
//
// Near the point 1/2 w |r|^2; far from it w d |r|. Gradient w / s J' r, model of the Hessian w / s J' J: never below the true one.
#ifndef CONTROLLER_OCP_OCP_FRAME_REACH_H_
#define CONTROLLER_OCP_OCP_FRAME_REACH_H_

#include "controller/ocp/ocp_view.h"
#include "controller/rbd/rbd_frames.h"

namespace engram {

template <class R, int frame> struct FrameReachTerm {
  static constexpr bool kNeedsGravity = false;
  static constexpr DofPath<R> path{R::frame_joint[frame]};
  template <class S> struct Param {
    S reach_w;     // [1/m^2]
    S reach_near;  // d [m], not zero
    S reach_p[3];  // p* [m], world axes
  };

  template <class S> static S cost(const Param<S>& p, const KnotView<R, S>& k) {
    Vec3<S> p_WF;
    return p.reach_w * p.reach_near * p.reach_near * (stretch(p, residual(p, k, p_WF)) - S(1.0));
  }

  template <class S> static S expand(const Param<S>& p, const KnotView<R, S>& k, ModelOf<R, S>& M) {
    Vec3<S> p_WF;
    const Vec3<S> r3 = residual(p, k, p_WF);
    const S s = stretch(p, r3);
    S J[3][R::nv], r[3], w[3];
    for (int a = 0; a < path.n; ++a) {
      const Motion<S>& column = k.d.J[path.dof[a]];
      const Vec3<S> lin = cross_add(column.ang, p_WF, column.lin);
      for (int i = 0; i < 3; ++i) J[i][a] = lin[i];
    }
    for (int i = 0; i < 3; ++i) {
      r[i] = r3[i];
      w[i] = p.reach_w / s;
    }
    add_gauss_newton(J, path.dof, path.n, r, w, M);
    return p.reach_w * p.reach_near * p.reach_near * (s - S(1.0));
  }

 private:
  template <class S> static Vec3<S> residual(const Param<S>& p, const KnotView<R, S>& k, Vec3<S>& p_WF) {
    Mat3<S> R_WF;
    rbd_frame_placement<R>(k.d, frame, R_WF, p_WF);
    return p_WF - Vec3<S>(p.reach_p[0], p.reach_p[1], p.reach_p[2]);
  }
  template <class S> static S stretch(const Param<S>& p, const Vec3<S>& r) {
    return sqrt(S(1.0) + dot(r, r) / (p.reach_near * p.reach_near));
  }
};

}  // namespace engram
#endif  // CONTROLLER_OCP_OCP_FRAME_REACH_H_
