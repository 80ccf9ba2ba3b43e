// The whole-body anchor problems, stated for our solver as bench/peers states them for Crocoddyl.
#ifndef BENCH_LEGGED_PROBLEMS_H_
#define BENCH_LEGGED_PROBLEMS_H_

#include "controller/fddp/fddp.h"
#include "controller/ocp/ocp_com.h"
#include "controller/ocp/ocp_contact.h"
#include "controller/ocp/ocp_frame.h"
#include "controller/ocp/ocp_limits.h"
#include "controller/ocp/ocp_regularization.h"
#include "controller/ocp/ocp.h"
#include "tables/anymal/robot.h"
#include "tables/hector/robot.h"
#include "tables/talos/robot.h"

#include <Eigen/QR>
#include <cmath>
#include <memory>

namespace engram::bench {

using robots::Talos;

struct TalosSoles {
  using Robot = Talos;
  static constexpr int n = 2;
  static constexpr int frame[n] = {Talos::kLeftSole, Talos::kRightSole};
  static constexpr ContactKind kind[n] = {ContactKind::kSurface, ContactKind::kSurface};
  static constexpr double kp = 0.0, kd = 30.0;
};
inline constexpr unsigned kLeftFoot = 1u, kRightFoot = 2u;

template <int foot> using TalosFoot = FramePlacementTerm<Talos, TalosSoles::frame[foot]>;
// Costs of the thesis: state, control, waypoint and landing of the swing foot.
using TalosThesis = ContactOcp<TalosSoles, StateTerm<Talos>, ControlTerm<Talos, false>, TalosFoot<0>, TalosFoot<1>>;
// Costs of Crocoddyl's biped example: also centre of mass, swing trajectory, wrench cones.
using TalosUtils = ContactOcp<TalosSoles, StateTerm<Talos>, ControlTerm<Talos, false>, TalosFoot<0>, TalosFoot<1>, ComTerm<Talos>,
                              WrenchConeTerm<0>, WrenchConeTerm<1>>;

// Least-norm controls that hold q at rest: g = B u + J' lambda.
template <class P> inline void quasi_static(const Real* q, unsigned active, Real* u) {
  using R = typename P::R;
  using C = typename P::Contacts;
  constexpr const ContactTree<C>& tree = kContactTree<C>;
  auto d = std::make_unique<RbdData<R, Real>>();
  ContactData<C, Real> cd;
  Vec<Real, P::nv> g;
  rbd_kinematics(q, *d);
  rbd_gravity(*d, g.data());
  rbd_contact_jacobians(*d, active, cd);
  const ActiveRows<C> rows(active);
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(P::nv, P::nu + rows.n);
  for (int k = 0; k < P::nv; ++k)
    for (int i = 0; i < P::nu; ++i) A(k, i) = Actuation<R>::entry(k, i);
  int column = P::nu;
  for (int c = 0; c < C::n; ++c)
    for (int r = 0; contact_active(active, c) && r < tree.rows[c]; ++r, ++column)
      for (int a = 0; a < tree.path_n[c]; ++a) A(tree.path[c][a], column) = motion_entry(cd.J[c][a], r);
  const Eigen::VectorXd solution = A.completeOrthogonalDecomposition().solve(g.template cast<double>());
  for (int i = 0; i < P::nu; ++i) u[i] = solution[i];
}

// Cold start: stand still at x0 under quasi-static controls.
template <class P, int N> void legged_cold_start(const Horizon<P, N>& h, FddpSolution<P, N>& s) {
  for (int k = 0; k <= h.n; ++k)
    for (int i = 0; i < P::nx; ++i) s.x[k][i] = h.x0[i];
  for (int k = 0; k < h.n; ++k) {
    for (int i = 0; i < P::nu; ++i) s.u[k][i] = 0.0;
    if ((h.phase[k] & kImpact) == 0) quasi_static<P>(h.x0, h.phase[k], s.u[k]);
  }
}

// Steps of Talos on flat ground, 40 ms knots: per step 7 knots of double support, 15 of swing, the touch-down; then double support.
template <class P, int N> class TalosWalk {
 public:
  TalosWalk(int T, int steps, Real length, Horizon<P, N>& h) : h_(h) {
    constexpr int kDouble = 7, kSwing = 15;
    constexpr double kHeight = 0.1;
    h = {};
    h.n = T;
    for (int i = 0; i < P::nq; ++i) h.x0[i] = Talos::q_home[i];
    auto d = std::make_unique<RbdData<Talos, Real>>();
    rbd_kinematics(h.x0, *d);
    rbd_subtree_moments(*d);
    Vec3<Real> foot[2], com = rbd_com(*d);
    Mat3<Real> R;
    for (int f = 0; f < 2; ++f) rbd_frame_placement(*d, TalosSoles::frame[f], R, foot[f]);
    com[0] = 0.5 * (foot[0][0] + foot[1][0]);
    com[1] = 0.5 * (foot[0][1] + foot[1][1]);

    int k = 0;
    for (int s = 0; s < steps; ++s) {
      for (int i = 0; i < kDouble; ++i) in_time(k++, kLeftFoot | kRightFoot);
      const int swing = s % 2 == 0 ? 1 : 0;  // right first
      const double stride = s == 0 ? length : 2 * length;
      Vec3<Real> target = foot[swing];
      for (int i = 0; i < kSwing; ++i, ++k) {
        const double phase = kSwing / 2.0, done = double(i + 1) / kSwing;
        target = foot[swing];
        target[0] += stride * done;
        target[2] += i < phase ? kHeight * i / phase : kHeight * (1 - (i - phase) / phase);
        in_time(k, swing == 1 ? kLeftFoot : kRightFoot);
        if (kThesis) {
          if (i == kSwing / 2) place(k, swing, target, kStep * 1e6);
        } else {
          place(k, swing, target, kStep * 1e6);
          Vec3<Real> c = com;
          c[0] += 0.5 * stride * done;
          track_com(k, c);
        }
      }
      touch_down(k++, swing, target);
      foot[swing][0] += stride;
      com[0] += 0.5 * stride;
    }
    while (k <= T) in_time(k++, kLeftFoot | kRightFoot);
  }

 private:
  static constexpr bool kThesis = std::is_same_v<P, TalosThesis>;
  static constexpr double kStep = 0.04;
  using Knot = typename P::template Knot<Real>;
  template <int f> using FootParam = typename TalosFoot<f>::template Param<Real>;
  template <int f> using ConeParam = typename WrenchConeTerm<f>::template Param<Real>;
  Horizon<P, N>& h_;

  // Weights of |x (-) x0|^2: base position, base orientation, joints, velocities.
  void weigh_state(Knot& knot, double position, double orientation, double joints, double velocity) {
    for (int i = 0; i < P::nx; ++i) knot.state_ref[i] = h_.x0[i];
    for (int i = 0; i < P::nv; ++i) {
      knot.state_w[i] = i < 3 ? position : i < 6 ? orientation : joints;
      knot.state_w[P::nv + i] = velocity;
    }
  }
  void in_time(int k, unsigned support) {
    Knot& knot = h_.knot[k];
    const bool terminal = k == h_.n;
    const double scale = terminal ? 1.0 : kStep;
    h_.phase[k] = support;
    knot.dt = terminal ? 0.0 : kStep;
    weigh_state(knot, 0.0, scale * 1e1 * (500.0 * 500.0), scale * 1e1 * (0.01 * 0.01), scale * 1e1 * (10.0 * 10.0));
    knot.control_w = terminal ? 0.0 : scale * 1e-1;
    if constexpr (!kThesis) {
      cone(static_cast<ConeParam<0>&>(knot), support & kLeftFoot ? scale * 1e1 : 0.0);
      cone(static_cast<ConeParam<1>&>(knot), support & kRightFoot ? scale * 1e1 : 0.0);
    }
  }
  template <class Cone> static void cone(Cone& p, double w) {
    p.wrench_w = w;
    p.wrench_mu = 0.7 * std::cos(0.25 * M_PI);  // four facets within the cone
    p.wrench_half[0] = 0.05;
    p.wrench_half[1] = 0.025;
    p.wrench_x[0] = 1.0;
  }
  void touch_down(int k, int foot, const Vec3<Real>& target) {
    h_.phase[k] = kImpact | (foot == 0 ? kLeftFoot : kRightFoot);
    weigh_state(h_.knot[k], 1e1, 1e1, 1e1 * (0.1 * 0.1), 1e1 * (10.0 * 10.0));
    place(k, foot, target, 1e8);
  }
  void place(int k, int foot, const Vec3<Real>& p, double w) {
    if (foot == 0) place(static_cast<FootParam<0>&>(h_.knot[k]), p, w);
    else place(static_cast<FootParam<1>&>(h_.knot[k]), p, w);
  }
  template <class Foot> static void place(Foot& foot, const Vec3<Real>& p, double w) {
    foot.placement_w = w;
    for (int i = 0; i < 3; ++i) {
      foot.placement_p[i] = p[i];
      foot.placement_R[4 * i] = 1.0;
    }
  }
  void track_com(int k, const Vec3<Real>& c) {
    if constexpr (!kThesis) {
      for (int i = 0; i < 3; ++i) {
        h_.knot[k].com_w[i] = kStep * 1e6;
        h_.knot[k].com_ref[i] = c[i];
      }
    } else {
      static_cast<void>(k);
      static_cast<void>(c);
    }
  }
};

// ---- ANYmal --------------------------------------------------------------------------------------------------------------

using robots::Anymal;

struct AnymalFeet {
  using Robot = Anymal;
  static constexpr int n = 4;
  static constexpr int frame[n] = {Anymal::kLfFoot, Anymal::kRfFoot, Anymal::kLhFoot, Anymal::kRhFoot};
  static constexpr ContactKind kind[n] = {ContactKind::kPoint, ContactKind::kPoint, ContactKind::kPoint, ContactKind::kPoint};
  static constexpr double kp = 0.0, kd = 50.0;
};
template <int foot> using AnymalFoot = FrameTranslationTerm<Anymal, AnymalFeet::frame[foot]>;
using AnymalProblem = ContactOcp<AnymalFeet, StateTerm<Anymal>, ControlTerm<Anymal, false>, LimitTerm<Anymal>, ComTerm<Anymal>,
                                 AnymalFoot<0>, AnymalFoot<1>, AnymalFoot<2>, AnymalFoot<3>, FrictionConeTerm<0>,
                                 FrictionConeTerm<1>, FrictionConeTerm<2>, FrictionConeTerm<3>>;
inline constexpr int kTrotKnots = 56;

// Two pairs of steps of a trot, 10 ms knots: 2 knots on four feet, 25 on two, the touch-down, twice; costs of Crocoddyl's example.
template <int N> class AnymalTrot {
 public:
  explicit AnymalTrot(Horizon<AnymalProblem, N>& h) : h_(h) {
    constexpr int kStand = 2, kSwing = 25;
    constexpr double kHeight = 0.1, kStride = 0.15;
    constexpr int pairs[2][2] = {{1, 2}, {0, 3}};  // feet that swing together
    h = {};
    h.n = kTrotKnots;
    for (int i = 0; i < AnymalProblem::nq; ++i) h.x0[i] = Anymal::q_home[i];
    auto d = std::make_unique<RbdData<Anymal, Real>>();
    rbd_kinematics(h.x0, *d);
    rbd_subtree_moments(*d);
    Vec3<Real> foot[4], com = rbd_com(*d);
    Mat3<Real> R;
    com[0] = com[1] = 0.0;
    for (int f = 0; f < 4; ++f) {
      rbd_frame_placement(*d, AnymalFeet::frame[f], R, foot[f]);
      for (int i = 0; i < 2; ++i) com[i] += 0.25 * foot[f][i];
    }
    int k = 0;
    for (int pair = 0; pair < 2; ++pair) {
      const unsigned swings = 1u << pairs[pair][0] | 1u << pairs[pair][1];
      const double stride = pair == 0 ? 0.5 * kStride : kStride;
      for (int i = 0; i < kStand; ++i) in_time(k++, 15u);
      Vec3<Real> target[2];
      for (int i = 0; i < kSwing; ++i, ++k) {
        const double phase = kSwing / 2.0, done = double(i + 1) / kSwing;
        in_time(k, 15u & ~swings);
        for (int j = 0; j < 2; ++j) {
          target[j] = foot[pairs[pair][j]];
          target[j][0] += stride * done;
          target[j][2] += i < phase ? kHeight * i / phase : kHeight * (1 - (i - phase) / phase);
          place(k, pairs[pair][j], target[j], kStep * 1e6);
        }
        for (int j = 0; j < 3; ++j) {
          h.knot[k].com_w[j] = kStep * 1e6;
          h.knot[k].com_ref[j] = com[j] + (j == 0 ? 0.5 * stride * done : 0.0);
        }
      }
      h.phase[k] = kImpact | swings;
      weigh_state(h.knot[k], 1e1, 1e1, 1e3, 1e3, 1e3);
      for (int j = 0; j < 2; ++j) {
        place(k, pairs[pair][j], target[j], 1e7);
        foot[pairs[pair][j]][0] += stride;
      }
      com[0] += 0.5 * stride;
      ++k;
    }
    in_time(k, 15u);
  }

 private:
  using Knot = typename AnymalProblem::template Knot<Real>;
  static constexpr double kStep = 0.01;
  Horizon<AnymalProblem, N>& h_;

  void weigh_state(Knot& knot, double position, double orientation, double joints, double base_velocity, double joint_velocity) {
    for (int i = 0; i < AnymalProblem::nx; ++i) knot.state_ref[i] = h_.x0[i];
    for (int i = 0; i < Anymal::nv; ++i) {
      knot.state_w[i] = i < 3 ? position : i < 6 ? orientation : joints;
      knot.state_w[Anymal::nv + i] = i < 6 ? base_velocity : joint_velocity;
    }
  }
  void in_time(int k, unsigned support) {
    Knot& knot = h_.knot[k];
    const bool terminal = k == h_.n;
    const double scale = terminal ? 1.0 : kStep;
    h_.phase[k] = support;
    knot.dt = terminal ? 0.0 : kStep;
    weigh_state(knot, 0.0, scale * 1e1 * (500.0 * 500.0), scale * 1e1 * (0.01 * 0.01), scale * 1e1 * (10.0 * 10.0), scale * 1e1);
    knot.control_w = terminal ? 0.0 : scale * 1e-1;
    knot.limit_w_q = knot.limit_w_v = scale * 1e3;
    cone<0>(knot, support, scale);
    cone<1>(knot, support, scale);
    cone<2>(knot, support, scale);
    cone<3>(knot, support, scale);
  }
  template <int foot> static void cone(Knot& knot, unsigned support, double scale) {
    auto& p = static_cast<typename FrictionConeTerm<foot>::template Param<Real>&>(knot);
    p.friction_w = contact_active(support, foot) ? scale * 1e1 : 0.0;
    p.friction_mu = 0.7;
  }
  template <int foot> static void place(Knot& knot, const Vec3<Real>& p, double w) {
    auto& term = static_cast<typename AnymalFoot<foot>::template Param<Real>&>(knot);
    term.translation_w = w;
    for (int i = 0; i < 3; ++i) term.translation_p[i] = p[i];
  }
  void place(int k, int foot, const Vec3<Real>& p, double w) {
    Knot& knot = h_.knot[k];
    foot == 0 ? place<0>(knot, p, w) : foot == 1 ? place<1>(knot, p, w) : foot == 2 ? place<2>(knot, p, w) : place<3>(knot, p, w);
  }
};

// ---- Hector --------------------------------------------------------------------------------------------------------------

using Hector = Ocp<robots::Hector, FramePlacementTerm<robots::Hector, robots::Hector::kBase>, StateTerm<robots::Hector>,
                   ControlTerm<robots::Hector, false>>;
inline constexpr int kFlightKnots = 33;

// From rest at the origin to (1, 0, 1), 30 ms knots.
template <int N> void hector_horizon(Horizon<Hector, N>& h) {
  constexpr double dt = 3e-2;
  h = {};
  h.n = kFlightKnots;
  h.x0[6] = 1.0;
  for (int k = 0; k <= h.n; ++k) {
    auto& knot = h.knot[k];
    const bool terminal = k == h.n;
    knot.dt = terminal ? 0.0 : dt;
    knot.placement_w = terminal ? 3.0 : 1e-2 * dt;
    knot.placement_p[0] = knot.placement_p[2] = 1.0;
    for (int i = 0; i < 3; ++i) knot.placement_R[4 * i] = 1.0;
    for (int i = 0; i < Hector::ndx; ++i) knot.state_w[i] = terminal ? 0.0 : 1e-6 * (i < 3 ? 0.1 : 1e3) * dt;
    knot.state_ref[6] = 1.0;
    knot.control_w = terminal ? 0.0 : 1e-6 * dt;
  }
}

// Hover at x0.
template <int N> void hector_cold_start(const Horizon<Hector, N>& h, FddpSolution<Hector, N>& s) {
  for (int k = 0; k <= h.n; ++k)
    for (int i = 0; i < Hector::nx; ++i) s.x[k][i] = h.x0[i];
  for (int k = 0; k < h.n; ++k)
    for (int i = 0; i < Hector::nu; ++i) s.u[k][i] = total_mass<robots::Hector>() * -robots::Hector::gravity[2] / Hector::nu;
}

}  // namespace engram::bench
#endif  // BENCH_LEGGED_PROBLEMS_H_
