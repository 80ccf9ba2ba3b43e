// The small analytic systems: their derivatives against central differences, and their optima by the solver.
#include "controller/fddp/fddp_solve.h"
#include "controller/ocp/ocp_systems.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <memory>
#include <random>

namespace engram {
namespace {

std::mt19937 rng(5);
double uniform() { return std::uniform_real_distribution<double>(-1, 1)(rng); }

template <class P> class OcpSystems : public ::testing::Test {};
using Systems = ::testing::Types<AnalyticOcp<Pendulum>, AnalyticOcp<Unicycle>, AnalyticOcp<Bicopter>>;
TYPED_TEST_SUITE(OcpSystems, Systems);

template <class P> typename P::template Knot<double> random_knot(double dt) {
  typename P::template Knot<double> knot = {};
  for (double& w : knot.w_x) w = 1.0 + uniform();
  for (double& w : knot.w_u) w = 1.0 + uniform();
  for (double& r : knot.x_ref) r = uniform();
  for (double& r : knot.u_ref) r = uniform();
  knot.dt = dt;
  return knot;
}

// Central differences with h = 1e-5 err by h^2 f'''/6 (third derivatives up to 10) and eps f / h (values up to 30): below 1e-9.
TYPED_TEST(OcpSystems, ModelMatchesCentralDifferences) {
  using P = TypeParam;
  using L = typename P::Layout;
  constexpr double h = 1e-5;
  for (int n = 0; n < 20; ++n) {
    const auto knot = random_knot<P>(0.05);
    double z[P::nz], next[P::nx], cost;
    typename P::template Model<double> M;
    for (double& x : z) x = 2 * uniform();
    P::linearize(knot, z, z + P::nx, next, cost, M);
    for (int i = 0; i < P::nz; ++i) {
      double plus[P::nx], minus[P::nx], cost_plus, cost_minus, moved[P::nz];
      std::copy(z, z + P::nz, moved);
      moved[i] = z[i] + h;
      P::calc(knot, moved, moved + P::nx, plus, cost_plus);
      moved[i] = z[i] - h;
      P::calc(knot, moved, moved + P::nx, minus, cost_minus);
      const int p = padded_index<L>(i);
      EXPECT_NEAR(M.Lz[p], (cost_plus - cost_minus) / (2 * h), 1e-9);
      for (int j = 0; j < P::nv; ++j) {
        EXPECT_NEAR(M.D[j][p], (plus[P::nq + j] - minus[P::nq + j]) / (2 * h), 1e-9) << "v' " << j << " by " << i;
        EXPECT_NEAR((i == j ? 1.0 : 0.0) + knot.dt * M.D[j][p], (plus[j] - minus[j]) / (2 * h), 1e-9) << "q' " << j << " by " << i;
      }
    }
  }
}

TYPED_TEST(OcpSystems, StepOfTheModelIsTheStep) {
  using P = TypeParam;
  const auto knot = random_knot<P>(0.02);
  double z[P::nz], a[P::nx], b[P::nx], cost_a, cost_b;
  typename P::template Model<double> M;
  for (double& x : z) x = uniform();
  P::linearize(knot, z, z + P::nx, a, cost_a, M);
  P::calc(knot, z, z + P::nx, b, cost_b);
  EXPECT_EQ(cost_a, cost_b);
  for (int i = 0; i < P::nx; ++i) EXPECT_NEAR(a[i], b[i], 1e-15 * (1 + std::fabs(b[i])));  // fused or not
}

// One problem: from x0 to the origin of q within T knots of dt, thrusts about u_ref.
template <class System, int T> struct Problem {
  using P = AnalyticOcp<System>;
  Horizon<P, T> h = {};
  FddpWork<P, T> w;
  FddpSolution<P, T> s;
  FddpStats stats;
  FddpOpts opts;

  Problem(std::array<double, P::nx> x0, double dt, double w_u, double u_ref) {
    h.n = T;
    std::copy(x0.begin(), x0.end(), h.x0);
    for (int k = 0; k <= T; ++k) {
      auto& knot = h.knot[k];
      knot.dt = k < T ? dt : 0.0;
      for (int i = 0; i < P::nq; ++i) knot.w_x[i] = k < T ? 1e-2 * dt : 1e3;
      for (int i = P::nq; i < P::nx; ++i) knot.w_x[i] = std::is_same_v<System, Unicycle> ? 0.0 : k < T ? 1e-2 * dt : 1e2;
      for (int i = 0; i < P::nu; ++i) knot.w_u[i] = k < T ? w_u * dt : 0.0, knot.u_ref[i] = u_ref;
      for (int i = 0; i < P::nx; ++i) s.x[k][i] = x0[i];
    }
    for (int k = 0; k < T; ++k)
      for (int i = 0; i < P::nu; ++i) s.u[k][i] = u_ref;
    opts.iterations = 300;
    opts.box = true;
  }
  FddpStatus solve() { return fddp_solve(h, opts, w, s, stats); }
  void expect_within_bounds() const {
    for (int k = 0; k < T; ++k)
      for (int i = 0; i < P::nu; ++i) {
        EXPECT_GE(s.u[k][i], P::u_lo(i));
        EXPECT_LE(s.u[k][i], P::u_hi(i));
      }
  }
};

TEST(OcpSystemsSolved, PendulumSwingsUpWithLessTorqueThanItsWeight) {
  static_assert(Pendulum::u_hi[0] < Pendulum::m * Pendulum::g * Pendulum::l);
  auto p = std::make_unique<Problem<Pendulum, 150>>(std::array{M_PI, 0.0}, 0.02, 1e-3, 0.0);
  p->s.u[0][0] = 0.1;  // hanging still is a saddle
  EXPECT_EQ(p->solve(), FddpStatus::kConverged);
  EXPECT_NEAR(p->s.x[150][0], 0.0, 0.05);
  EXPECT_NEAR(p->s.x[150][1], 0.0, 0.05);
  p->expect_within_bounds();
}

TEST(OcpSystemsSolved, UnicycleParksSideways) {
  auto p = std::make_unique<Problem<Unicycle, 100>>(std::array{0.0, 1.0, 0.0, 0.0, 0.0, 0.0}, 0.03, 1e-2, 0.0);
  for (auto& u : p->s.u) u[0] = u[1] = 0.5;  // at rest, turning leads nowhere: a saddle
  EXPECT_EQ(p->solve(), FddpStatus::kConverged);
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(p->s.x[100][i], 0.0, 0.02);
  p->expect_within_bounds();
}

TEST(OcpSystemsSolved, BicopterFliesToItsGoalAndStaysThere) {
  auto p = std::make_unique<Problem<Bicopter, 60>>(std::array{-2.0, -1.0, 0.0, 0.0, 0.0, 0.0}, 0.05, 1e-3, Bicopter::hover);
  EXPECT_EQ(p->solve(), FddpStatus::kConverged);
  for (int i = 0; i < 6; ++i) EXPECT_NEAR(p->s.x[60][i], 0.0, 0.02);
  p->expect_within_bounds();
}

}  // namespace
}  // namespace engram
