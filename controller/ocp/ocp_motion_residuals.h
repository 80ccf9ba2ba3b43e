// Residuals of motion: state, position, rotation and velocity of a frame, centroidal momentum. To be used in a ResidualTerm.
//
// Along dof k of joint j, with parent velocity V_p and spatial quantities at the world origin, the tree beyond k turns with J_k:
//   dV_i/dq_k = J_k x (V_i - V_p)                  seen from axes that move with body i: V_p x J_k
//   dh/dq_k   = J_k x* h_k + Yc_k (V_p x J_k)      h = sum Y_i V_i, h_k and Yc_k momentum and inertia of the subtree of k
#ifndef CONTROLLER_OCP_OCP_MOTION_RESIDUALS_H_
#define CONTROLLER_OCP_OCP_MOTION_RESIDUALS_H_

#include "controller/ocp/ocp_residual.h"
#include "controller/rbd/rbd_com.h"
#include "controller/rbd/rbd_frames.h"
#include "controller/rbd/rbd_manifold.h"

namespace engram {

// x (-) x*, of a fixed base: a vector.
template <class R> struct State {
  static_assert(!kFreeBase<R>, "of a free base: StateTerm, StateBoundTerm");
  using Robot = R;
  static constexpr int rows = 2 * R::nv;
  static constexpr bool kOfVelocity = true;
  static constexpr AllDofs<R> path{};
  template <class S> struct Reference {
    S x[2 * R::nv];
  };

  template <class S> static void value(const Reference<S>& ref, const KnotView<R, S>& k, S (&r)[rows]) {
    for (int i = 0; i < R::nv; ++i) {
      r[i] = k.q[i] - ref.x[i];
      r[R::nv + i] = k.v[i] - ref.x[R::nv + i];
    }
  }
  template <class S> static void jacobian(const Reference<S>&, const KnotView<R, S>&, S (&J)[rows][2 * R::nv]) {
    for (int i = 0; i < rows; ++i)
      for (int j = 0; j < rows; ++j) J[i][j] = i == j ? 1.0 : 0.0;
  }
};

// p_WF - p*
template <class R, int frame> struct FrameTranslation {
  using Robot = R;
  static constexpr int rows = 3;
  static constexpr bool kOfVelocity = false;
  static constexpr DofPath<R> path{R::frame_joint[frame]};
  template <class S> struct Reference {
    S p[3];  // p* [m], world axes
  };

  template <class S> static void value(const Reference<S>& ref, const KnotView<R, S>& k, S (&r)[rows]) {
    const Vec3<S> p_WF = at(k);
    for (int i = 0; i < 3; ++i) r[i] = p_WF[i] - ref.p[i];
  }
  template <class S> static void jacobian(const Reference<S>&, const KnotView<R, S>& k, S (&J)[rows][2 * R::nv]) {
    const Vec3<S> p_WF = at(k);
    for (int a = 0; a < path.n; ++a) {
      const Motion<S> column = moved_to(k.d.J[path.dof[a]], p_WF);
      for (int i = 0; i < 3; ++i) J[i][a] = column.lin[i];
    }
  }

 private:
  template <class S> static Vec3<S> at(const KnotView<R, S>& k) {
    Mat3<S> R_WF;
    Vec3<S> p_WF;
    rbd_frame_placement<R>(k.d, frame, R_WF, p_WF);
    return p_WF;
  }
};

// log3(R*' R_WF)
template <class R, int frame> struct FrameRotation {
  using Robot = R;
  static constexpr int rows = 3;
  static constexpr bool kOfVelocity = false;
  static constexpr DofPath<R> path{R::frame_joint[frame]};
  template <class S> struct Reference {
    S R_WF[9];  // R*, row-major
  };

  template <class S> static void value(const Reference<S>& ref, const KnotView<R, S>& k, S (&r)[rows]) {
    Mat3<S> R_WF;
    const Vec3<S> e = error(ref, k, R_WF);
    for (int i = 0; i < 3; ++i) r[i] = e[i];
  }
  template <class S> static void jacobian(const Reference<S>& ref, const KnotView<R, S>& k, S (&J)[rows][2 * R::nv]) {
    Mat3<S> R_WF;
    const Vec3<S> e = error(ref, k, R_WF);
    const Mat3<S> J_R = matmul<S>(jlog3<S>(e), R_WF.transpose());  // d e = Jlog3 R_FW w_W
    for (int a = 0; a < path.n; ++a) {
      const Vec3<S> column = mul(J_R, k.d.J[path.dof[a]].ang);
      for (int i = 0; i < 3; ++i) J[i][a] = column[i];
    }
  }

 private:
  template <class S> static Vec3<S> error(const Reference<S>& ref, const KnotView<R, S>& k, Mat3<S>& R_WF) {
    Vec3<S> p_WF;
    Mat3<S> R_ref;
    rbd_frame_placement<R>(k.d, frame, R_WF, p_WF);
    for (int i = 0; i < 9; ++i) R_ref(i / 3, i % 3) = ref.R_WF[i];
    return log3<S>(matmul_transposed(R_ref, R_WF));
  }
};

// V_WF - V*, in the given axes: (linear, angular).
template <class R, int frame, Axes axes> struct FrameVelocity {
  using Robot = R;
  static constexpr int rows = 6;
  static constexpr bool kOfVelocity = true;
  static constexpr int joint = R::frame_joint[frame];
  static constexpr DofPath<R> path{joint};
  template <class S> struct Reference {
    S V[6];  // V* [m/s, rad/s]
  };

  template <class S> static void value(const Reference<S>& ref, const KnotView<R, S>& k, S (&r)[rows]) {
    Mat3<S> R_WF;
    Vec3<S> p_WF;
    rbd_frame_placement<R>(k.d, frame, R_WF, p_WF);
    put(seen_from<axes>(k.d.V[joint], R_WF, p_WF), [&](int i, S s) { r[i] = s - ref.V[i]; });
  }
  template <class S> static void jacobian(const Reference<S>&, const KnotView<R, S>& k, S (&J)[rows][2 * R::nv]) {
    const Motion<S>& V = k.d.V[joint];
    Mat3<S> R_WF;
    Vec3<S> p_WF;
    rbd_frame_placement<R>(k.d, frame, R_WF, p_WF);
    for (int a = 0; a < path.n; ++a) {
      const int dof = path.dof[a], parent = R::parent[kTree<R>.joint[dof]];
      const Motion<S>& Jk = k.d.J[dof];
      const Motion<S> Vp = parent < 0 ? Motion<S>::zero() : k.d.V[parent];
      Motion<S> dV = axes == Axes::kLocal ? cross(Vp, Jk) : cross(Jk, V - Vp);
      dV = seen_from<axes>(dV, R_WF, p_WF);
      if constexpr (axes == Axes::kLocalWorldAligned) dV.lin = cross_add<S>(V.ang, moved_to(Jk, p_WF).lin, dV.lin);  // the origin moves
      put(dV, [&](int i, S s) { J[i][a] = s; });
      put(seen_from<axes>(Jk, R_WF, p_WF), [&](int i, S s) { J[i][path.n + a] = s; });
    }
  }

 private:
  template <class S, class F> static void put(const Motion<S>& m, F f) {
    for (int i = 0; i < 6; ++i) f(i, motion_entry(m, i));
  }
};

// Centroidal momentum less its reference: linear [kg m/s], then angular about the centre of mass [kg m^2/s], world axes.
template <class R_> struct CentroidalMomentum {
  using R = R_;
  using Robot = R;
  static constexpr int rows = 6;
  static constexpr bool kOfVelocity = true;
  static constexpr AllDofs<R> path{};
  template <class S> struct Reference {
    S h[6];
  };

  template <class S> static void value(const Reference<S>& ref, const KnotView<R, S>& k, S (&r)[rows]) {
    Force<S> h[R::nj];
    momenta(k, h);
    const Force<S> at_com = about(rbd_com(k.d), h[0]);
    for (int i = 0; i < 3; ++i) {
      r[i] = at_com.lin[i] - ref.h[i];
      r[3 + i] = at_com.ang[i] - ref.h[3 + i];
    }
  }
  template <class S> static void jacobian(const Reference<S>&, const KnotView<R, S>& k, S (&J)[rows][2 * R::nv]) {
    Force<S> h[R::nj];
    momenta(k, h);
    const Vec3<S> c = rbd_com(k.d);
    for (int a = 0; a < R::nv; ++a) {
      const int i = kTree<R>.joint[a], parent = R::parent[i];
      const Motion<S>& Jk = k.d.J[a];
      const Motion<S> dV = parent < 0 ? Motion<S>::zero() : cross(k.d.V[parent], Jk);
      Force<S> dq = about(c, cross_add(Jk, h[i], k.d.Yc[i] * dV));
      dq.ang -= cross(rbd_com_column(k.d, a), h[0].lin);
      const Force<S> dv = about(c, k.d.Yc[i] * Jk);
      for (int e = 0; e < 3; ++e) {
        J[e][a] = dq.lin[e];
        J[3 + e][a] = dq.ang[e];
        J[e][R::nv + a] = dv.lin[e];
        J[3 + e][R::nv + a] = dv.ang[e];
      }
    }
  }

 private:
  static_assert(R::nsub[0] == R::nj, "one tree");
  // h[i]: momentum of the subtree of i about the world origin.
  template <class S> static void momenta(const KnotView<R, S>& k, Force<S> (&h)[R::nj]) {
    for (int i = 0; i < R::nj; ++i) h[i] = k.d.Y[i] * k.d.V[i];
    for (int i = R::nj - 1; i > 0; --i) h[R::parent[i]] += h[i];
  }
  template <class S> static Force<S> about(const Vec3<S>& c, const Force<S>& h) { return {h.lin, h.ang - cross(c, h.lin)}; }
};

}  // namespace engram
#endif  // CONTROLLER_OCP_OCP_MOTION_RESIDUALS_H_
