// Costs of thesis chapter 7 on an arm: inverse kinematics (B.3), target reaching and pick-and-place (B.4, B.5), with gradients.
// Kinematics, collision spheres and obstacles are the controller's own.
#ifndef CODEGEN_OFFLINE_STUDY_ARM_H_
#define CODEGEN_OFFLINE_STUDY_ARM_H_

#include "controller/rbd/rbd_frames.h"

#include <array>
#include <cmath>
#include <vector>

namespace engram::offline {

// What an arm's cost sees of one posture, and the way back: a force [cost/m] and a torque [cost] at the world origin on every joint's
// subtree give the gradient with respect to q. slopes: false where no gradient is asked for.
template <class R, class S, bool slopes> struct ArmPosture {
  RbdData<R, S> d;
  Vec3<S> force[R::nj], torque[R::nj];

  explicit ArmPosture(const S* q) {
    rbd_kinematics(q, d);
    if constexpr (slopes)
      for (int i = 0; i < R::nj; ++i) force[i] = torque[i] = Vec3<S>::Zero();
  }
  void push(int joint, const Vec3<S>& p, const Vec3<S>& f) {
    if constexpr (slopes) {
      force[joint] += f;
      torque[joint] += cross(p, f);
    }
  }
  void twist(int joint, const Vec3<S>& m) {
    if constexpr (slopes) torque[joint] += m;
  }

  // gradient (nv) += J' (force, torque)
  void add_gradient(S* gradient) {
    for (int i = R::nj - 1; i >= 0; --i) {
      gradient[R::iv[i]] += dot_add(d.J[R::iv[i]].lin, force[i], dot(d.J[R::iv[i]].ang, torque[i]));
      if (const int p = R::parent[i]; p >= 0) {
        force[p] += force[i];
        torque[p] += torque[i];
      }
    }
  }
};

// CHOMP's obstacle cost of a distance: -x + e/2 inside, (x - e)^2 / 2e within e of the surface, 0 beyond. slope = d cost / d x.
template <class S> ENGRAM_INLINE S obstacle_cost(const S& distance, double e, S& slope) {
  const S gap = min(distance - e, S(0.0)), zero = 0.0;
  const auto inside = distance < zero;
  slope = select(inside, S(-1.0), gap * (1.0 / e));
  return select(inside, 0.5 * e - distance, gap * gap * (0.5 / e));
}

// |v| and its gradient v / |v| (0 at 0).
template <class S> ENGRAM_INLINE S length(const Vec3<S>& v, Vec3<S>& unit) {
  const S n = sqrt(dot(v, v));
  unit = v * (1.0 / max(n, S(1e-9)));
  return n;
}

// Setup M: Robot, Field (count, distance), frame, clearance [m] within which obstacles cost, orientation(): what the frame's axes cost;
// `space`: dimensions of a target, 2 in the plane z = 0, where no orientation is asked for.
template <class M, class S, bool slopes> struct ArmTerms {
  using R = typename M::Robot;
  using Posture = ArmPosture<R, S, slopes>;

  // sum over the collision spheres of the cost of the nearest obstacle, times weight
  static S obstacles(Posture& posture, double weight) {
    S c = 0.0;
    for (int s = 0; s < R::nsphere; ++s) {
      const Vec3<S> p = rbd_sphere_position<R>(posture.d, s);
      Vec3<S> g;
      S nearest = M::Field::template distance<S>(0, p, g);
      for (int o = 1; o < M::Field::count; ++o) {
        Vec3<S> g_o;
        const S distance = M::Field::template distance<S>(o, p, g_o);
        const auto closer = distance < nearest;
        for (int i = 0; i < 3; ++i) g[i] = select(closer, g_o[i], g[i]);
        nearest = min(nearest, distance);
      }
      S slope;
      c += weight * obstacle_cost<S>(nearest - R::sphere_radius[s], M::clearance, slope);
      posture.push(R::sphere_joint[s], p, g * (weight * slope));
    }
    return c;
  }

  // weight_p |p_WF - target| + weight_R orientation
  static S target(Posture& posture, const S* target, double weight_p, double weight_R) {
    constexpr int joint = R::frame_joint[M::frame];
    Mat3<S> R_WF;
    Vec3<S> p_WF, unit, moment;
    rbd_frame_placement(posture.d, M::frame, R_WF, p_WF);
    S c = weight_p * length<S>(p_WF - Vec3<S>(target[0], target[1], M::space == 3 ? target[2] : S(0.0)), unit);
    posture.push(joint, p_WF, unit * S(weight_p));
    if constexpr (M::space == 3) {
      c += weight_R * M::template orientation<S>(R_WF, moment);
      posture.twist(joint, moment * S(weight_R));
    }
    return c;
  }

  // How many kinds of cost there are: position, and obstacles and orientation where they are asked for.
  static constexpr int kinds = 1 + (M::Field::count > 0) + (M::space == 3);
};

// 1 - (a . z)^2: the frame's axis `a` is vertical, up or down; free about z (thesis B.3). moment: the gradient as a torque.
template <class S> S vertical_axis(const Vec3<S>& a, Vec3<S>& moment) {
  const Vec3<S> z(0.0, 0.0, 1.0);
  const S along = dot(a, z);
  moment = cross<S>(a, z) * (-2.0 * along);
  return 1.0 - along * along;
}
// 1 - <q, q*>^2 = (3 - tr(R*' R)) / 4: the frame's axes are the world's (thesis B.3, UR10).
template <class S> S axes_of_world(const Mat3<S>& R_WF, Vec3<S>& moment) {
  moment = Vec3<S>::Zero();
  S trace = 0.0;
  for (int j = 0; j < 3; ++j) {
    Vec3<S> e = Vec3<S>::Zero();
    e[j] = 1.0;
    trace += R_WF(j, j);
    moment += cross<S>(R_WF.column(j), e);
  }
  moment = moment * S(-0.25);
  return 0.25 * (3.0 - trace);
}

// Inverse kinematics: x = (target p [m], q [rad]).  C = 1/m (C_p / 0.05 + C_obst / 0.01 + C_orient / 0.2), m = number of terms (B.3).
template <class M> struct InverseKinematicsCost {
  using R = typename M::Robot;
  static constexpr int ntask = M::space, d = ntask + R::nq;

  template <class S> S operator()(const S* x, S* gradient) const {
    return gradient ? evaluate<true>(x, gradient) : evaluate<false>(x, gradient);
  }

 private:
  template <bool slopes, class S> static S evaluate(const S* x, S* gradient) {
    using Terms = ArmTerms<M, S, slopes>;
    constexpr double share = 1.0 / Terms::kinds;
    typename Terms::Posture posture(x + ntask);
    S c = Terms::target(posture, x, share / 0.05, share / 0.2);
    if constexpr (M::Field::count > 0) c += Terms::obstacles(posture, share / 0.01);
    if constexpr (slopes) {
      for (int k = 0; k < d; ++k) gradient[k] = 0.0;
      posture.add_gradient(gradient + ntask);
    }
    return c;
  }
};

// Motion primitives (B.5): from q_0 to q_1 with two radial basis functions per joint, the line between the ends kept, clipped to the
// joint limits, smoothed by a moving average over a path that is held at both ends: zero velocity there.
struct Primitive {
  static constexpr int kGrid = 12, kWindow = 4, kPoints = kGrid + kWindow, kBasis = 2;  // point 0 is q_0, the last one q_1
  static constexpr double kCenter[kBasis] = {0.3, 0.7}, kSharpness = 12.0;
  double phi[kGrid + 1][kBasis], line[kGrid + 1];

  Primitive() {
    const auto rbf = [](int j, double t) { return std::exp(-kSharpness * (t - kCenter[j]) * (t - kCenter[j])); };
    for (int l = 0; l <= kGrid; ++l) {
      const double t = line[l] = double(l) / kGrid;
      for (int j = 0; j < kBasis; ++j) phi[l][j] = rbf(j, t) - rbf(j, 0) - t * (rbf(j, 1) - rbf(j, 0));
    }
  }
};
inline const Primitive kPrimitive;

// One motion of an arm: its path through the obstacles, and its length.
template <class M, class S, bool slopes> struct ArmMotion {
  using R = typename M::Robot;
  static constexpr int nq = R::nq, nw = Primitive::kBasis * nq;
  S q0[nq], q1[nq], w[nw];         // ends and weights, w[Primitive::kBasis k + j] of joint k
  S dq0[nq], dq1[nq], dw[nw];      // gradient, added to

  // weight_o * obstacles summed over the path + weight_l * length + weight_R * orientation, mean over the path; length: mean of the
  // joints' path [rad, root mean square] and the frame's [m]
  S cost(double weight_o, double weight_l, double weight_R = 0.0) {
    constexpr int G = Primitive::kGrid, W = Primitive::kWindow, P = Primitive::kPoints;
    S z[nq][G + 1], z_bar[nq][G + 1], c = 0.0;
    for (int k = 0; k < nq; ++k)
      for (int l = 0; l <= G; ++l) {
        S v = madd(S(kPrimitive.line[l]), q1[k] - q0[k], q0[k]);
        for (int j = 0; j < Primitive::kBasis; ++j) v = madd(S(kPrimitive.phi[l][j]), w[Primitive::kBasis * k + j], v);
        const auto inside = (v > S(R::q_lo[k])) & (v < S(R::q_hi[k]));
        z[k][l] = min(max(v, S(R::q_lo[k])), S(R::q_hi[k]));
        z_bar[k][l] = select(inside, S(1.0), S(0.0));  // the clip's derivative, then the gradient
      }
    S path_bar[nq][P];  // gradient with respect to the path's points
    for (auto& row : path_bar)
      for (S& g : row) g = 0.0;
    const double weight_q = 0.5 * weight_l / std::sqrt(double(nq)), weight_p = 0.5 * weight_l;
    S q[nq], q_last[nq];
    Vec3<S> p_last, J_last[nq];
    for (int k = 0; k < nq; ++k) q[k] = q0[k];
    for (int o = 0; o < P; ++o) {
      for (int k = 0; k < nq; ++k) {
        q_last[k] = q[k];
        S sum = 0.0;
        for (int l = o - W + 1; l <= o; ++l) sum += z[k][l < 0 ? 0 : l > G ? G : l];
        q[k] = sum * (1.0 / W);
      }
      ArmPosture<R, S, slopes> posture(q);
      if (o > 0) c += ArmTerms<M, S, slopes>::obstacles(posture, weight_o);
      Mat3<S> R_WF;
      Vec3<S> p_WF;
      rbd_frame_placement(posture.d, M::frame, R_WF, p_WF);
      if constexpr (M::space == 3) {
        if (weight_R > 0 && o > 0) {
          Vec3<S> moment;
          c += (weight_R / (P - 1)) * M::template orientation<S>(R_WF, moment);
          posture.twist(R::frame_joint[M::frame], moment * S(weight_R / (P - 1)));
        }
      }
      Vec3<S> J[nq], unit;
      for (int k = 0; k < nq; ++k) J[k] = cross_add(posture.d.J[k].ang, p_WF, posture.d.J[k].lin);
      if (o > 0) {
        S square = 0.0;
        for (int k = 0; k < nq; ++k) square = madd(q[k] - q_last[k], q[k] - q_last[k], square);
        const S step = sqrt(square), inverse = weight_q / max(step, S(1e-9));
        c += weight_q * step + weight_p * length<S>(p_WF - p_last, unit);
        for (int k = 0; k < nq; ++k) {
          const S pull = inverse * (q[k] - q_last[k]);
          path_bar[k][o] += madd(S(weight_p), dot(J[k], unit), pull);
          path_bar[k][o - 1] -= madd(S(weight_p), dot(J_last[k], unit), pull);
        }
      }
      p_last = p_WF;
      for (int k = 0; k < nq; ++k) J_last[k] = J[k];
      if constexpr (slopes) {
        S g[nq];
        for (S& gk : g) gk = 0.0;
        posture.add_gradient(g);
        for (int k = 0; k < nq; ++k) path_bar[k][o] += g[k];
      }
    }
    if constexpr (!slopes) return c;
    for (int k = 0; k < nq; ++k) {
      S sum[G + 1];
      for (S& s : sum) s = 0.0;
      for (int o = 0; o < P; ++o)
        for (int l = o - W + 1; l <= o; ++l) sum[l < 0 ? 0 : l > G ? G : l] += path_bar[k][o];
      for (int l = 0; l <= G; ++l) {
        const S g = sum[l] * z_bar[k][l] * (1.0 / W);
        dq0[k] = madd(S(1.0 - kPrimitive.line[l]), g, dq0[k]);
        dq1[k] = madd(S(kPrimitive.line[l]), g, dq1[k]);
        for (int j = 0; j < Primitive::kBasis; ++j)
          dw[Primitive::kBasis * k + j] = madd(S(kPrimitive.phi[l][j]), g, dw[Primitive::kBasis * k + j]);
      }
    }
    return c;
  }
};

// Motions through `stops` targets, from the nominal posture and, if `home_again`, back to it (B.4):
//   C = 1/4 (C_p / 0.05 + C_obst / 0.1 + C_orient / 0.2 + C_control / 2),   means over targets and motions; in the plane 1/3, no C_orient
// x = (targets [m], postures at them [rad], weights of each motion).
template <class M, int stops, bool home_again> struct MotionCost {
  using R = typename M::Robot;
  static constexpr int nq = R::nq, nw = Primitive::kBasis * nq, motions = stops + (home_again ? 1 : 0);
  static constexpr int ntask = M::space * stops, d = ntask + stops * nq + motions * nw;

  template <class S> S operator()(const S* x, S* gradient) const {
    return gradient ? evaluate<true>(x, gradient) : evaluate<false>(x, gradient);
  }

 private:
  template <bool slopes, class S> static S evaluate(const S* x, S* gradient) {
    constexpr double share = 1.0 / (1 + ArmTerms<M, S, slopes>::kinds);
    const S* posture_of = x + ntask;
    const S* weights_of = posture_of + stops * nq;
    S g[d];
    for (S& gk : g) gk = 0.0;
    S c = 0.0;
    for (int i = 0; i < stops; ++i) {
      ArmPosture<R, S, slopes> posture(posture_of + i * nq);
      c += ArmTerms<M, S, slopes>::target(posture, x + M::space * i, share / 0.05 / stops, share / 0.2 / stops);
      if constexpr (slopes) posture.add_gradient(g + ntask + i * nq);
    }
    for (int i = 0; i < motions; ++i) {
      ArmMotion<M, S, slopes> motion;
      for (int k = 0; k < nq; ++k) {
        motion.q0[k] = i == 0 ? S(R::q_home[k]) : posture_of[(i - 1) * nq + k];
        motion.q1[k] = i == stops ? S(R::q_home[k]) : posture_of[i * nq + k];
        motion.dq0[k] = motion.dq1[k] = 0.0;
      }
      for (int k = 0; k < nw; ++k) {
        motion.w[k] = weights_of[i * nw + k];
        motion.dw[k] = 0.0;
      }
      c += motion.cost(share / 0.1 / motions, share / 2 / motions);
      if constexpr (!slopes) continue;
      for (int k = 0; k < nq; ++k) {
        if (i > 0) g[ntask + (i - 1) * nq + k] += motion.dq0[k];
        if (i < stops) g[ntask + i * nq + k] += motion.dq1[k];
      }
      for (int k = 0; k < nw; ++k) g[ntask + stops * nq + i * nw + k] += motion.dw[k];
    }
    if constexpr (slopes)
      for (int k = 0; k < d; ++k) gradient[k] = g[k];
    return c;
  }
};

// One motion between two given postures, its weights x alone to be found (B.6):
//   C = 1/3 (C_obst / 0.1 + C_control / 2 + C_orient / 0.2),   C_orient of the whole way; in the plane 1/2, no C_orient
template <class M> struct TransferCost {
  using R = typename M::Robot;
  static constexpr int ntask = 0, d = Primitive::kBasis * R::nq;
  std::array<double, R::nq> from, to;

  template <class S> S operator()(const S* x, S* gradient) const {
    return gradient ? evaluate<true>(x, gradient) : evaluate<false>(x, gradient);
  }

 private:
  template <bool slopes, class S> S evaluate(const S* x, S* gradient) const {
    ArmMotion<M, S, slopes> motion;
    for (int k = 0; k < R::nq; ++k) {
      motion.q0[k] = from[k];
      motion.q1[k] = to[k];
      motion.dq0[k] = motion.dq1[k] = 0.0;
    }
    for (int k = 0; k < d; ++k) {
      motion.w[k] = x[k];
      motion.dw[k] = 0.0;
    }
    constexpr double share = 1.0 / ArmTerms<M, S, slopes>::kinds;
    const S c = motion.cost(share / 0.1, share / 2, share / 0.2);
    if constexpr (slopes)
      for (int k = 0; k < d; ++k) gradient[k] = motion.dw[k];
    return c;
  }
};

// An arm's path as points q (kPoints, nq) of the motion primitive with ends q0, q1 and weights w.
template <class R> void primitive_path(const double* q0, const double* q1, const double* w, double* q) {
  constexpr int G = Primitive::kGrid, W = Primitive::kWindow;
  for (int k = 0; k < R::nq; ++k) {
    double z[G + 1];
    for (int l = 0; l <= G; ++l) {
      z[l] = q0[k] + kPrimitive.line[l] * (q1[k] - q0[k]);
      for (int j = 0; j < Primitive::kBasis; ++j) z[l] += kPrimitive.phi[l][j] * w[Primitive::kBasis * k + j];
      z[l] = min(max(z[l], double(R::q_lo[k])), double(R::q_hi[k]));
    }
    for (int o = 0; o < Primitive::kPoints; ++o) {
      double sum = 0;
      for (int l = o - W + 1; l <= o; ++l) sum += z[l < 0 ? 0 : l > G ? G : l];
      q[o * R::nq + k] = sum / W;
    }
  }
}

// The box of a cost: `postures` times the joint limits, then `motions` times weights within the joint limits (thesis 7.5.3).
template <class R> void append_joints(int postures, int motions, std::vector<double>& lo, std::vector<double>& hi) {
  const auto joints = [&](int each) {
    for (int k = 0; k < R::nq; ++k) {
      lo.insert(lo.end(), each, R::q_lo[k]);
      hi.insert(hi.end(), each, R::q_hi[k]);
    }
  };
  for (int i = 0; i < postures; ++i) joints(1);
  for (int i = 0; i < motions; ++i) joints(Primitive::kBasis);
}

}  // namespace engram::offline
#endif  // CODEGEN_OFFLINE_STUDY_ARM_H_
