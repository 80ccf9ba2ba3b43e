// Contacts and impacts: the equations of motion, every derivative against central differences, phases and lanes.
// options: -Og
#include "bench/legged_problems.h"
#include "controller/fddp/fddp_solve.h"
#include "tests/support/count_heap.h"
#include "tests/support/figures.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>

namespace engram {
namespace {

using namespace engram::bench;

// Central differences of a function of size 1e2 with step 1e-6: rounding 1e-16 * 1e2 / 1e-6 = 1e-8, truncation 1e-12; times a few tens of
// coordinates that add up.
constexpr double kStep = 1e-6, kDifference = 5e-7;
// One evaluation in double precision: 1e-16 times the largest terms (forces of 1e3 N over a path of tens of products).
constexpr double kRounding = 1e-9;

// Talos' soles once more, pulled to their places by both gains.
struct StiffSoles : TalosSoles {
  static constexpr double kp = 40.0, kd = 12.0;
};
struct StiffFeet : AnymalFeet {
  static constexpr double kp = 40.0, kd = 12.0;
};
using StiffTalos = ContactOcp<StiffSoles, StateTerm<Talos>, ComTerm<Talos>, ContactForceTerm<StiffSoles, 0>, WrenchConeTerm<1>>;
using StiffAnymal = ContactOcp<StiffFeet, StateTerm<Anymal>, FrictionConeTerm<0>, ContactForceTerm<StiffFeet, 3>>;

double wave(int i) { return std::sin(1.0 + 2.3 * i); }

// A state off the nominal posture, moving, with controls; seed makes them differ.
template <class P> void random_point(int seed, double* x, double* u) {
  double dx[P::Layout::nxp] = {}, x0[P::nx] = {};
  for (int i = 0; i < P::nq; ++i) x0[i] = P::R::q_home[i];
  for (int i = 0; i < P::nv; ++i) {
    dx[P::Layout::oq + i] = 0.2 * wave(i + 100 * seed);
    dx[P::Layout::ov + i] = 0.5 * wave(i + 100 * seed + 50);
  }
  P::integrate(x0, dx, x);
  for (int i = 0; i < P::nu; ++i) u[i] = 0.1 * wave(i + 100 * seed + 77);  // Talos' fingers weigh 1e-4 kg m^2
}

template <class P> void weigh(typename P::template Knot<double>& k) {
  for (int i = 0; i < 2 * P::nv; ++i) k.state_w[i] = 1.0 + 0.1 * i;
  for (int i = 0; i < P::nq; ++i) k.state_ref[i] = P::R::q_home[i];
}
template <class Reference> void refer(Reference& ref, int n) {  // 0.3 rad about x, off the feet
  for (int c = 0; c < n; ++c) {
    const double R[9] = {1, 0, 0, 0, std::cos(0.3), -std::sin(0.3), 0, std::sin(0.3), std::cos(0.3)};
    for (int i = 0; i < 9; ++i) ref.R[c][i] = R[i];
    for (int i = 0; i < 3; ++i) ref.p[c][i] = 0.1 * wave(i + 3 * c);
  }
}
void weigh_com(double (&w)[3], double size) {
  for (int i = 0; i < 3; ++i) w[i] = size * (1 + i);
}
// A sole turned by 0.4 rad.
template <class Cone> void turn(Cone& p) {
  p.wrench_x[0] = std::cos(0.4);
  p.wrench_x[1] = std::sin(0.4);
}
template <class P> typename P::template Knot<double> make_knot() {
  typename P::template Knot<double> k = {};
  k.dt = 0.04;
  weigh<P>(k);
  if constexpr (std::is_same_v<P, TalosUtils>) {
    k.control_w = 1e-3;
    weigh_com(k.com_w, 50.0);
    static_cast<typename TalosFoot<0>::Param<double>&>(k).placement_w = 3.0;
    static_cast<typename TalosFoot<1>::Param<double>&>(k).placement_w = 2.0;
    for (auto* R : {static_cast<typename TalosFoot<0>::Param<double>&>(k).placement_R, static_cast<typename TalosFoot<1>::Param<double>&>(k).placement_R})
      R[0] = R[4] = R[8] = 1.0;
    const auto cone = [](auto& p) {
      p.wrench_w = 1e-3;
      p.wrench_mu = 0.5;
      p.wrench_half[0] = 0.05;
      p.wrench_half[1] = 0.03;
      turn(p);
    };
    cone(static_cast<WrenchConeTerm<0>::Param<double>&>(k));
    cone(static_cast<WrenchConeTerm<1>::Param<double>&>(k));
  } else if constexpr (std::is_same_v<P, StiffTalos>) {
    weigh_com(k.com_w, 50.0);
    k.force_w = 1e-3;
    k.force_ref[2] = 300.0;
    k.wrench_w = 1e-3;
    k.wrench_mu = 0.5;
    k.wrench_half[0] = k.wrench_half[1] = 0.05;
    turn(k);
    refer(k.contact_ref, 2);
  } else if constexpr (std::is_same_v<P, StiffAnymal>) {
    k.friction_w = 1e-2;
    k.friction_mu = 0.5;
    k.force_w = 1e-2;
    k.force_ref[2] = 80.0;
    refer(k.contact_ref, 4);
  } else {
    k.control_w = 1e-3;
    k.limit_w_q = k.limit_w_v = 10.0;
    weigh_com(k.com_w, 20.0);
    static_cast<typename AnymalFoot<2>::Param<double>&>(k).translation_w = 5.0;
    auto& p = static_cast<FrictionConeTerm<1>::Param<double>&>(k);
    p.friction_w = 1e-2;
    p.friction_mu = 0.5;
  }
  return k;
}

// The model of one knot through the lanes, of which `lane` is it and the others are other states.
template <class P> void linearize(unsigned phase, const double* x, const double* u, int lane, typename P::LqModel& m, double* x_next, double& cost) {
  auto knot = make_knot<P>();
  if (phase & kImpact) knot.dt = 0.0;
  auto lanes = std::make_unique<typename P::Lanes>();
  typename P::template Knot<Pack> knots;
  for (std::size_t e = 0; e < sizeof(knot) / sizeof(double); ++e)
    reinterpret_cast<Pack*>(&knots)[e] = reinterpret_cast<const double*>(&knot)[e];
  Pack xs[P::nx], us[P::nu], next[P::nx], costs;
  for (int l = 0; l < kLanes; ++l) {
    double xl[P::nx], ul[P::nu];
    random_point<P>(10 + l, xl, ul);
    for (int i = 0; i < P::nx; ++i) xs[i].l[l] = l == lane ? x[i] : xl[i];
    for (int i = 0; i < P::nu; ++i) us[i].l[l] = l == lane ? u[i] : ul[i];
  }
  P::linearize(phase, knots, xs, us, next, costs, *lanes);
  P::finish(phase, knot.dt, *lanes, lane, m);
  for (int i = 0; i < P::nx; ++i) x_next[i] = next[i].l[lane];
  cost = costs.l[lane];
}

// Largest error of entry i of column z, relative to the entries' size.
struct Error {
  double worst = 0.0;
  void add(double a, double b, double scale) { worst = std::max(worst, std::fabs(a - b) / std::max(1.0, scale)); }
};

// D, E, G, F and Lz of the model at a point, against central differences of calc.
template <class P> void check_derivatives(unsigned phase, int seed) {
  using L = typename P::Layout;
  using C = typename P::Contacts;
  auto knot = make_knot<P>();
  const bool impact = (phase & kImpact) != 0;
  if (impact) knot.dt = 0.0;
  const double dt = knot.dt;
  double x[P::nx], u[P::nu], x_next[P::nx], cost, next_calc[P::nx], cost_calc;
  random_point<P>(seed, x, u);
  auto m = std::make_unique<typename P::LqModel>();
  linearize<P>(phase, x, u, 1, *m, x_next, cost);
  P::calc(phase, knot, x, u, next_calc, cost_calc);
  for (int i = 0; i < P::nx; ++i) EXPECT_NEAR(x_next[i], next_calc[i], kRounding);
  EXPECT_NEAR(cost, cost_calc, kRounding * std::fabs(cost));

  Error state, gradient, force;
  for (int z = 0; z < P::nz; ++z) {
    if (impact && z >= P::ndx) break;
    double next[2][P::nx], costs[2], lambda[2][P::nf];
    for (int side = 0; side < 2; ++side) {
      double dx[L::nxp] = {}, xp[P::nx], up[P::nu], h = side ? kStep : -kStep;
      if (z < P::ndx) dx[padded_index<L>(z)] = h;
      P::integrate(x, dx, xp);
      for (int i = 0; i < P::nu; ++i) up[i] = u[i] + (z == P::ndx + i ? h : 0.0);
      P::calc(phase, knot, xp, up, next[side], costs[side]);
      auto d = std::make_unique<RbdData<typename P::R, double>>();
      ContactData<C, double> cd;
      double a[P::nv], tau[P::nv];
      Actuation<typename P::R>::apply(up, tau);
      if (impact) rbd_impulse(xp, xp + P::nq, phase & ~kImpact, *d, cd, a);
      else rbd_contact_dynamics(xp, xp + P::nq, tau, knot.reference(), phase, *d, cd, a);
      for (int r = 0; r < P::nf; ++r) lambda[side][r] = cd.lambda[r];
    }
    double dx_next[L::nxp];
    P::difference(next[0], next[1], dx_next);
    const int zp = padded_index<L>(z);
    double column[P::nv];  // of d q' / d z
    for (int i = 0; i < P::nv; ++i) column[i] = (z == i && i >= 6 ? 1.0 : 0.0) + (i >= 6 ? dt * m->D[i][zp] : 0.0);
    for (int i = 0; i < 6; ++i) {
      if (z < 6) column[i] += m->E(i, z);
      for (int j = 0; j < 6; ++j) column[i] += dt * m->G(i, j) * m->D[j][zp];
    }
    double scale = 0.0;
    for (int i = 0; i < P::nv; ++i) scale = std::max(scale, std::fabs(m->D[i][zp]));
    for (int i = 0; i < P::nv; ++i) {
      state.add(column[i], dx_next[L::oq + i] / (2 * kStep), scale);
      state.add(m->D[i][zp], dx_next[L::ov + i] / (2 * kStep), scale);
    }
    gradient.add(m->Lz[zp], (costs[1] - costs[0]) / (2 * kStep), std::fabs(cost));
    for (int c = 0; c < C::n; ++c) {
      if (!contact_active(phase & ~kImpact, c)) continue;
      double largest = 0.0;
      for (int r = kContactTree<C>.first[c]; r < kContactTree<C>.first[c + 1]; ++r) largest = std::max(largest, std::fabs(m->F[r][zp]));
      for (int r = kContactTree<C>.first[c]; r < kContactTree<C>.first[c + 1]; ++r)
        force.add(m->F[r][zp], (lambda[1][r] - lambda[0][r]) / (2 * kStep), largest);
    }
  }
  EXPECT_LT(state.worst, kDifference);
  EXPECT_LT(gradient.worst, kDifference);
  EXPECT_LT(force.worst, 10 * kDifference);  // forces are 1e3, ten times the accelerations
}

TEST(OcpContact, DerivativesOfSurfacesAgreeWithDifferences) {
  for (unsigned phase : {kLeftFoot, kRightFoot, kLeftFoot | kRightFoot}) check_derivatives<TalosUtils>(phase, phase);
}
TEST(OcpContact, DerivativesOfPointsAgreeWithDifferences) {
  for (unsigned phase : {1u, 6u, 9u, 13u}) check_derivatives<AnymalProblem>(phase, phase);
}
TEST(OcpContact, DerivativesWithPositionGainAgreeWithDifferences) {
  check_derivatives<StiffTalos>(kLeftFoot | kRightFoot, 3);
  check_derivatives<StiffAnymal>(9u, 4);
}
TEST(OcpContact, DerivativesOfImpactsAgreeWithDifferences) {
  check_derivatives<TalosUtils>(kImpact | kRightFoot, 5);
  check_derivatives<AnymalProblem>(kImpact | 6u, 6);
}
TEST(OcpContact, NoContactIsFreeFlight) { check_derivatives<AnymalProblem>(0u, 7); }

// M a + b = tau + J' lambda, and the contact frames accelerate as the stabilization asks.
template <class P> void check_dynamics(unsigned phase) {
  using R = typename P::R;
  using C = typename P::Contacts;
  const auto knot = make_knot<P>();
  double x[P::nx], u[P::nu], tau[P::nv], a[P::nv], torque[P::nv];
  random_point<P>(2, x, u);
  Actuation<R>::apply(u, tau);
  auto d = std::make_unique<RbdData<R, double>>();
  ContactData<C, double> cd;
  rbd_contact_dynamics(x, x + P::nq, tau, knot.reference(), phase, *d, cd, a);
  auto r = std::make_unique<RbdData<R, double>>();
  rbd_rnea(x, x + P::nq, a, *r, torque);
  for (int c = 0; c < C::n; ++c) {
    if (!contact_active(phase, c)) continue;
    Mat3<double> R_WF;
    Vec3<double> p;
    Mat<double, 6, R::nv> J;
    rbd_frame_placement(*r, C::frame[c], R_WF, p);
    rbd_frame_jacobian(*r, C::frame[c], p, J);
    const int rows = kContactTree<C>.rows[c], i = kContactTree<C>.joint[c];
    for (int k = 0; k < P::nv; ++k)
      for (int e = 0; e < rows; ++e) torque[k] -= J(e, k) * cd.lambda[kContactTree<C>.first[c] + e];
    const Motion<double> V = moved_to(r->V[i], p);
    Motion<double> A = moved_to(r->A[i], p);
    A.lin += constant3<double>(R::gravity);
    if (rows == 3) A.lin += cross(V.ang, V.lin);
    for (int e = 0; e < rows; ++e) {
      const double expected = -C::kd * motion_entry(V, e) - (C::kp > 0.0 ? C::kp * motion_entry(cd.error[c], e) : 0.0);
      EXPECT_NEAR(motion_entry(A, e), expected, kRounding) << "contact " << c << " row " << e;
    }
  }
  for (int k = 0; k < P::nv; ++k) EXPECT_NEAR(torque[k], tau[k], kRounding) << "dof " << k;
}
TEST(OcpContact, DynamicsHoldsNewtonAndTheConstraint) {
  check_dynamics<TalosUtils>(kLeftFoot | kRightFoot);
  check_dynamics<TalosUtils>(kRightFoot);
  check_dynamics<AnymalProblem>(13u);
  check_dynamics<StiffTalos>(3u);
  check_dynamics<StiffAnymal>(6u);
}

// An impact leaves the feet at rest and takes energy.
TEST(OcpContact, ImpactStopsTheFeet) {
  using P = TalosUtils;
  double x[P::nx], u[P::nu], dv[P::nv], v[P::nv];
  random_point<P>(2, x, u);
  auto d = std::make_unique<RbdData<Talos, double>>();
  ContactData<TalosSoles, double> cd;
  rbd_impulse(x, x + P::nq, 3u, *d, cd, dv);
  for (int i = 0; i < P::nv; ++i) v[i] = x[P::nq + i] + dv[i];
  const auto energy = [&](const double* w) {
    double e = 0.0;
    rbd_velocity(w, *d);
    for (int i = 0; i < Talos::nj; ++i) e += 0.5 * dot(d->V[i], d->Y[i] * d->V[i]);
    for (int k = 0; k < P::nv; ++k) e += 0.5 * Talos::armature[k] * w[k] * w[k];
    return e;
  };
  EXPECT_LT(energy(v), energy(x + P::nq));
  rbd_velocity(v, *d);
  for (int c = 0; c < 2; ++c) {
    const Motion<double> V = moved_to(d->V[kContactTree<TalosSoles>.joint[c]], cd.p_WF[c]);
    for (int e = 0; e < 6; ++e) EXPECT_NEAR(motion_entry(V, e), 0.0, kRounding);
  }
}

// A lane's model is the same in whichever lane the knot stands, bit for bit.
TEST(OcpContact, LanesDoNotMix) {
  using P = TalosUtils;
  double x[P::nx], u[P::nu], next[2][P::nx], cost[2];
  random_point<P>(8, x, u);
  auto a = std::make_unique<P::LqModel>(), b = std::make_unique<P::LqModel>();
  linearize<P>(kLeftFoot, x, u, 0, *a, next[0], cost[0]);
  linearize<P>(kLeftFoot, x, u, kLanes - 1, *b, next[1], cost[1]);
  EXPECT_EQ(cost[0], cost[1]);
  EXPECT_EQ(std::memcmp(a->D, b->D, sizeof(a->D)), 0);
  EXPECT_EQ(std::memcmp(a->Lz, b->Lz, sizeof(a->Lz)), 0);
  for (int i = 0; i < P::nv; ++i)
    for (int j = 0; j <= i; ++j) EXPECT_EQ(a->Hqq[i][j], b->Hqq[i][j]);
}

constexpr int kTalosKnots = 100;  // at most
template <class P> struct TalosMemory {
  Horizon<P, kTalosKnots> h;
  FddpWork<P, kTalosKnots> w;
  FddpSolution<P, kTalosKnots> s;
};
template <class P> TalosMemory<P> talos_memory;

// A state that is not a number ends as a status.
TEST(OcpContact, NotANumberStateIsRefused) {
  auto& [h, w, s] = talos_memory<TalosThesis>;
  static FddpStats stats;
  TalosWalk<TalosThesis, kTalosKnots>(30, 1, 0.3, h);
  legged_cold_start(h, s);
  s.x[3][5] = std::nan("");
  EXPECT_EQ(fddp_solve(h, FddpOpts{}, w, s, stats), FddpStatus::kNotFinite);
}

// The anchors: iterations and cost of Crocoddyl 3.2.1 on the same problems (bench/run.py re-measures them).
template <class P, int N> void check_anchor(const Horizon<P, N>& h, FddpWork<P, N>& w, FddpSolution<P, N>& s, int iterations, double cost) {
  FddpStats stats;
  calls = 0;
  counting = true;
  const FddpStatus status = fddp_solve(h, FddpOpts{}, w, s, stats);
  counting = false;
  EXPECT_EQ(calls, 0) << "calls of an allocator";
  EXPECT_EQ(status, FddpStatus::kConverged);
  EXPECT_NEAR(stats.iterations, iterations, 1);
  EXPECT_NEAR(s.cost, cost, 1e-7 * cost);  // both stop on an expected improvement below 1e-9
}
template <class P> void check_talos(int iterations, double cost) {
  auto& [h, w, s] = talos_memory<P>;
  TalosWalk<P, kTalosKnots>(30, 1, 0.3, h);
  legged_cold_start(h, s);
  check_anchor(h, w, s, iterations, cost);
}
TEST(OcpContact, TalosStepsLikeThePeer) {
  check_talos<TalosThesis>(9, 1126.532839);
  check_talos<TalosUtils>(14, 1832.276072);
}
TEST(OcpContact, TheCounterSeesAnAllocation) {
  calls = 0;
  counting = true;
  int* volatile planted = new int(1);
  delete planted;
  counting = false;
  EXPECT_EQ(calls, 2);
}
// Horizon, scratch and solution of Talos with 100 knots (Crocoddyl: about 400 MB of heap).
TEST(OcpContact, TalosFitsIntoItsMemory) {
  constexpr long long bytes = sizeof(TalosMemory<TalosUtils>);
  test::write_figure("memory", "size.talos100.solver_bytes", bytes, "B", 1);
  EXPECT_LT(bytes, 16'000'000);
}
TEST(OcpContact, AnymalTrotsLikeThePeer) {
  static Horizon<AnymalProblem, kTrotKnots> h;
  static FddpWork<AnymalProblem, kTrotKnots> w;
  static FddpSolution<AnymalProblem, kTrotKnots> s;
  AnymalTrot<kTrotKnots>{h};
  legged_cold_start(h, s);
  check_anchor(h, w, s, 8, 231.7924777);
}
TEST(OcpContact, HectorFliesLikeThePeer) {
  static Horizon<Hector, kFlightKnots> h;
  static FddpWork<Hector, kFlightKnots> w;
  static FddpSolution<Hector, kFlightKnots> s;
  hector_horizon(h);
  hector_cold_start(h, s);
  check_anchor(h, w, s, 31, 0.005208641226);
}

}  // namespace
}  // namespace engram
