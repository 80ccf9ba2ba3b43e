// Collision avoidance: the robot's spheres against a field of obstacles.
//
//   1/2 w sum_{sphere s, obstacle o} max(0, margin + r_s - d_o(p_s))^2
//
// A field says how many obstacles it holds, gives the signed distance to each, with its gradient, and tells at less cost whether one
// is farther than some reach: BoxField for boxes, GridField for one sampled signed distance field.
#ifndef CONTROLLER_OCP_OCP_OBSTACLES_H_
#define CONTROLLER_OCP_OCP_OBSTACLES_H_

#include "controller/ocp/ocp_view.h"
#include "controller/rbd/rbd_frames.h"

namespace engram {

// World W: nbox, p_WO[nbox][3], R_WO[nbox][9] (row-major), half[nbox][3]: centre, axes and half sizes of the boxes [m], constexpr.
template <class W> struct BoxField {
  static constexpr int count = W::nbox;

  // Whether the distance of p to box i is at least `reach` in every lane: if it is along one axis of the box.
  template <class S> static bool far(int i, const Vec3<S>& p, S reach) {
    const Vec3<S> c = in_box(i, p);
    return !any(max(max(abs(c[0]) - S(W::half[i][0]), abs(c[1]) - S(W::half[i][1])), abs(c[2]) - S(W::half[i][2])) < reach);
  }

  // Signed distance of p to box i, negative inside; gradient in world axes (unit length almost everywhere).
  template <class S> static S distance(int i, const Vec3<S>& p, Vec3<S>& gradient) {
    const Vec3<S> c = in_box(i, p);
    Vec3<S> excess, sign;  // per axis: how far beyond the face, and on which side
    for (int k = 0; k < 3; ++k) {
      sign[k] = select(c[k] < S(0.0), S(-1.0), S(1.0));
      excess[k] = abs(c[k]) - S(W::half[i][k]);
    }
    const Vec3<S> out(max(excess[0], S(0.0)), max(excess[1], S(0.0)), max(excess[2], S(0.0)));
    const S outside = sqrt(dot(out, out));
    const S deepest = max(max(excess[0], excess[1]), excess[2]);  // < 0 inside: distance to the nearest face
    const S inverse = S(1.0) / max(outside, S(1e-12));
    Vec3<S> g;
    for (int k = 0; k < 3; ++k) {
      const S face = select(excess[k] >= deepest, S(1.0), S(0.0));
      g[k] = sign[k] * select(deepest > S(0.0), out[k] * inverse, face);
    }
    if constexpr (kAligned) gradient = g;
    else gradient = mul(constant33<S>(W::R_WO[i]), g);
    return select(deepest > S(0.0), outside, deepest);
  }

 private:
  // All boxes along the axes of the world: nothing to turn.
  static constexpr bool kAligned = [] {
    for (int i = 0; i < count; ++i)
      for (int e = 0; e < 9; ++e)
        if (W::R_WO[i][e] != (e % 4 == 0 ? 1.0 : 0.0)) return false;
    return true;
  }();
  // p in the axes of box i, from its centre.
  template <class S> static Vec3<S> in_box(int i, const Vec3<S>& p) {
    const Vec3<S> from_centre = p - constant3<S>(W::p_WO[i]);
    if constexpr (kAligned) return from_centre;
    else return mul_transposed(constant33<S>(W::R_WO[i]), from_centre);
  }
};

// Grid G: sdf[nx * ny * nz] (float, x fastest), nx, ny, nz, origin[3] of the first node, cell (m), constexpr or static.
// Trilinear between the nodes; beyond the border the value at the border.
template <class G> struct GridField {
  static constexpr int count = 1;

  template <class S> static bool far(int, const Vec3<S>&, S) { return false; }
  template <class S> static S distance(int, const Vec3<S>& p, Vec3<S>& gradient) {
    S d = 0.0;
    for (int l = 0; l < lanes_of<S>; ++l) {  // a gather: lane by lane
      Real at[3] = {lane(p[0], l), lane(p[1], l), lane(p[2], l)}, g[3];
      set_lane(d, l, trilinear(at, g));
      for (int k = 0; k < 3; ++k) set_lane(gradient[k], l, g[k]);
    }
    return d;
  }

 private:
  static Real trilinear(const Real (&p)[3], Real (&g)[3]) {
    constexpr int n[3] = {G::nx, G::ny, G::nz};
    int i[3];
    Real t[3];
    for (int k = 0; k < 3; ++k) {
      Real c = (p[k] - G::origin[k]) / G::cell;
      c = c >= 0.0 ? c : 0.0;  // also for NaN
      c = c < n[k] - 1 ? c : n[k] - 1;
      i[k] = c < n[k] - 2 ? static_cast<int>(c) : n[k] - 2;
      t[k] = c - i[k];
    }
    const auto node = [&](int a, int b, int c) {
      return static_cast<Real>(G::sdf[(i[0] + a) + G::nx * ((i[1] + b) + G::ny * (i[2] + c))]);
    };
    Real d = 0.0;
    g[0] = g[1] = g[2] = 0.0;
    for (int c = 0; c < 2; ++c)
      for (int b = 0; b < 2; ++b)
        for (int a = 0; a < 2; ++a) {
          const Real wx = a ? t[0] : 1 - t[0], wy = b ? t[1] : 1 - t[1], wz = c ? t[2] : 1 - t[2], v = node(a, b, c);
          d += wx * wy * wz * v;
          g[0] += (a ? 1 : -1) * wy * wz * v / G::cell;
          g[1] += (b ? 1 : -1) * wx * wz * v / G::cell;
          g[2] += (c ? 1 : -1) * wx * wy * v / G::cell;
        }
    return d;
  }
};

// Spheres: nsphere, sphere_joint, p_JS, sphere_radius; the robot itself, or a task with spheres of its own.
template <class R, class Field, class Spheres = R> struct ObstacleTerm {
  static constexpr bool kNeedsGravity = false;
  template <class S> struct Param {
    S obstacle_w;       // weight [1/m^2]
    S obstacle_margin;  // distance kept [m]
  };

  template <class S> static S cost(const Param<S>& p, const KnotView<R, S>& k) {
    S c = 0.0;
    for (int s = 0; s < Spheres::nsphere; ++s) {
      const Vec3<S> center = rbd_sphere_position<R, Spheres>(k.d, s);
      const S reach = p.obstacle_margin + S(Spheres::sphere_radius[s]);
      for (int o = 0; o < Field::count; ++o) {
        if (Field::far(o, center, reach)) continue;
        Vec3<S> g;
        const S e = max(reach - Field::distance(o, center, g), S(0.0));
        c += e * e;
      }
    }
    return S(0.5) * p.obstacle_w * c;
  }

  template <class S> static S expand(const Param<S>& p, const KnotView<R, S>& k, ModelOf<R, S>& M) {
    S c = 0.0;
    for (int s = 0; s < Spheres::nsphere; ++s) {
      const Vec3<S> center = rbd_sphere_position<R, Spheres>(k.d, s);
      const S reach = p.obstacle_margin + S(Spheres::sphere_radius[s]);
      bool near = false;
      Vec3<S> gradient = Vec3<S>::Zero();  // - sum_o e_o g_o
      S H[6] = {0.0, 0.0, 0.0, 0.0, 0.0, 0.0};  // sum_o [e_o > 0] g_o g_o': xx xy xz yy yz zz
      for (int o = 0; o < Field::count; ++o) {
        if (Field::far(o, center, reach)) continue;
        near = true;
        Vec3<S> g;
        const S e = max(reach - Field::distance(o, center, g), S(0.0));
        const S active = select(e > S(0.0), S(1.0), S(0.0));
        c += e * e;
        gradient -= g * e;
        const Vec3<S> ag = g * active;
        for (int i = 0, n = 0; i < 3; ++i)
          for (int j = i; j < 3; ++j) H[n++] += ag[i] * g[j];
      }
      if (near) add_point(p.obstacle_w, DofPath<R>(Spheres::sphere_joint[s]), center, gradient, H, k.d, M);
    }
    return S(0.5) * p.obstacle_w * c;
  }

 private:
  // Adds w J' gradient and w J' H J of a point of the robot, J (3 x n) its Jacobian in world axes.
  template <class S>
  static void add_point(S w, const DofPath<R>& path, const Vec3<S>& center, const Vec3<S>& gradient, const S (&H)[6],
                        const RbdData<R, S>& d, ModelOf<R, S>& M) {
    Vec3<S> J[R::nv];
    for (int a = 0; a < path.n; ++a) {
      const Motion<S>& column = d.J[path.dof[a]];
      J[a] = column.lin + cross(column.ang, center);
      const Vec3<S> HJ = Vec3<S>(H[0] * J[a][0] + H[1] * J[a][1] + H[2] * J[a][2], H[1] * J[a][0] + H[3] * J[a][1] + H[4] * J[a][2],
                                 H[2] * J[a][0] + H[4] * J[a][1] + H[5] * J[a][2]) * w;
      M.Lz[path.dof[a]] += w * dot(J[a], gradient);
      for (int b = 0; b <= a; ++b) M.Lzz[path.dof[a]][path.dof[b]] += dot(HJ, J[b]);
    }
  }
};

}  // namespace engram
#endif  // CONTROLLER_OCP_OCP_OBSTACLES_H_
