// Terms on the placement of a frame of the robot.
#ifndef CONTROLLER_OCP_OCP_FRAME_H_
#define CONTROLLER_OCP_OCP_FRAME_H_

#include "controller/ocp/ocp_view.h"
#include "controller/rbd/rbd_frames.h"
#include "controller/rbd/rbd_manifold.h"

namespace engram {

// 1/2 w_p |p_WF - p*|^2 + 1/2 w_R |log3(R*' R_WF)|^2: position in world axes and rotation, weighted apart.
template <class R, int frame> struct FramePoseTerm {
  static constexpr bool kNeedsGravity = false;
  static constexpr DofPath<R> path{R::frame_joint[frame]};
  template <class S> struct Param {
    S pose_w_p, pose_w_R;  // weights [1/m^2, 1/rad^2]
    S pose_p[3];           // p* [m], world axes
    S pose_R[9];           // R*, row-major
  };

  template <class S> static S cost(const Param<S>& p, const KnotView<R, S>& k) {
    Mat3<S> R_WF;
    Vec3<S> p_WF, r_p, r_R;
    residual(p, k, R_WF, p_WF, r_p, r_R);
    return S(0.5) * (p.pose_w_p * dot(r_p, r_p) + p.pose_w_R * dot(r_R, r_R));
  }

  template <class S> static S expand(const Param<S>& p, const KnotView<R, S>& k, ModelOf<R, S>& M) {
    Mat3<S> R_WF;
    Vec3<S> p_WF, r_p, r_R;
    residual(p, k, R_WF, p_WF, r_p, r_R);
    const Mat3<S> J_R = matmul<S>(jlog3<S>(r_R), R_WF.transpose());  // d r_R = Jlog3 R_FW w_W
    S J[6][R::nv], r[6], w[6];
    for (int a = 0; a < path.n; ++a) {
      const Motion<S>& column = k.d.J[path.dof[a]];
      const Vec3<S> lin = column.lin + cross(column.ang, p_WF), ang = mul(J_R, column.ang);
      for (int i = 0; i < 3; ++i) {
        J[i][a] = lin[i];
        J[3 + i][a] = ang[i];
      }
    }
    for (int i = 0; i < 3; ++i) {
      r[i] = r_p[i];
      r[3 + i] = r_R[i];
      w[i] = p.pose_w_p;
      w[3 + i] = p.pose_w_R;
    }
    add_gauss_newton(J, path.dof, path.n, r, w, M);
    return S(0.5) * (p.pose_w_p * dot(r_p, r_p) + p.pose_w_R * dot(r_R, r_R));
  }

 private:
  template <class S>
  static void residual(const Param<S>& p, const KnotView<R, S>& k, Mat3<S>& R_WF, Vec3<S>& p_WF, Vec3<S>& r_p, Vec3<S>& r_R) {
    rbd_frame_placement<R>(k.d, frame, R_WF, p_WF);
    r_p = p_WF - Vec3<S>(p.pose_p[0], p.pose_p[1], p.pose_p[2]);
    Mat3<S> R_ref;
    for (int i = 0; i < 9; ++i) R_ref(i / 3, i % 3) = p.pose_R[i];
    r_R = log3<S>(matmul_transposed(R_ref, R_WF));
  }
};

// 1/2 w |log6(M*^-1 M_WF)|^2: the placement as one twist, as Crocoddyl's FramePlacement residual measures it.
template <class R, int frame> struct FramePlacementTerm {
  static constexpr bool kNeedsGravity = false;
  static constexpr DofPath<R> path{R::frame_joint[frame]};
  template <class S> struct Param {
    S placement_w;
    S placement_p[3];  // p* [m], world axes
    S placement_R[9];  // R*, row-major
  };

  template <class S> static S cost(const Param<S>& p, const KnotView<R, S>& k) {
    Mat3<S> R_WF, R_e;
    Vec3<S> p_WF, p_e;
    S r[6], c = 0.0;
    residual(p, k, R_WF, p_WF, R_e, p_e, r);
    for (const S& e : r) c += e * e;
    return S(0.5) * p.placement_w * c;
  }

  template <class S> static S expand(const Param<S>& p, const KnotView<R, S>& k, ModelOf<R, S>& M) {
    Mat3<S> R_WF, R_e;
    Vec3<S> p_WF, p_e;
    S r[6], w[6], c = 0.0;
    residual(p, k, R_WF, p_WF, R_e, p_e, r);
    const Mat<S, 6, 6> Jlog = jlog6(Vec3<S>(r[3], r[4], r[5]), p_e);
    S J[6][R::nv];
    for (int a = 0; a < path.n; ++a) {  // J = Jlog6 J_local
      const Motion<S>& column = k.d.J[path.dof[a]];
      const Vec3<S> lin = mul_transposed(R_WF, Vec3<S>(column.lin + cross(column.ang, p_WF)));
      const Vec3<S> ang = mul_transposed(R_WF, column.ang);
      for (int i = 0; i < 6; ++i) {
        J[i][a] = Jlog(i, 0) * lin[0] + Jlog(i, 1) * lin[1] + Jlog(i, 2) * lin[2] + Jlog(i, 3) * ang[0] + Jlog(i, 4) * ang[1] +
                  Jlog(i, 5) * ang[2];
      }
    }
    for (int i = 0; i < 6; ++i) {
      w[i] = p.placement_w;
      c += r[i] * r[i];
    }
    add_gauss_newton(J, path.dof, path.n, r, w, M);
    return S(0.5) * p.placement_w * c;
  }

 private:
  // M_e = M*^-1 M_WF and its logarithm r = (linear, angular).
  template <class S>
  static void residual(const Param<S>& p, const KnotView<R, S>& k, Mat3<S>& R_WF, Vec3<S>& p_WF, Mat3<S>& R_e, Vec3<S>& p_e,
                       S (&r)[6]) {
    rbd_frame_placement<R>(k.d, frame, R_WF, p_WF);
    Mat3<S> R_ref;
    for (int i = 0; i < 9; ++i) R_ref(i / 3, i % 3) = p.placement_R[i];
    R_e = matmul_transposed(R_ref, R_WF);
    p_e = mul_transposed(R_ref, Vec3<S>(p_WF - Vec3<S>(p.placement_p[0], p.placement_p[1], p.placement_p[2])));
    const Motion<S> m = log6(R_e, p_e);
    for (int i = 0; i < 3; ++i) {
      r[i] = m.lin[i];
      r[3 + i] = m.ang[i];
    }
  }
};

// 1/2 w |p_WF - p*|^2: the position alone.
template <class R, int frame> struct FrameTranslationTerm {
  static constexpr bool kNeedsGravity = false;
  static constexpr DofPath<R> path{R::frame_joint[frame]};
  template <class S> struct Param {
    S translation_w;     // [1/m^2]
    S translation_p[3];  // p* [m], world axes
  };

  template <class S> static S cost(const Param<S>& p, const KnotView<R, S>& k) {
    Vec3<S> p_WF;
    const Vec3<S> r = residual(p, k, p_WF);
    return S(0.5) * p.translation_w * dot(r, r);
  }

  template <class S> static S expand(const Param<S>& p, const KnotView<R, S>& k, ModelOf<R, S>& M) {
    Vec3<S> p_WF;
    const Vec3<S> r3 = residual(p, k, p_WF);
    S J[3][R::nv], r[3], w[3];
    for (int a = 0; a < path.n; ++a) {
      const Motion<S>& column = k.d.J[path.dof[a]];
      const Vec3<S> lin = cross_add(column.ang, p_WF, column.lin);
      for (int i = 0; i < 3; ++i) J[i][a] = lin[i];
    }
    for (int i = 0; i < 3; ++i) {
      r[i] = r3[i];
      w[i] = p.translation_w;
    }
    add_gauss_newton(J, path.dof, path.n, r, w, M);
    return S(0.5) * p.translation_w * dot(r3, r3);
  }

 private:
  template <class S> static Vec3<S> residual(const Param<S>& p, const KnotView<R, S>& k, Vec3<S>& p_WF) {
    Mat3<S> R_WF;
    rbd_frame_placement<R>(k.d, frame, R_WF, p_WF);
    return p_WF - Vec3<S>(p.translation_p[0], p.translation_p[1], p.translation_p[2]);
  }
};

}  // namespace engram
#endif  // CONTROLLER_OCP_OCP_FRAME_H_
