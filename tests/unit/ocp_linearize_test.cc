// A knot's linear-quadratic model against central differences of its step and cost, for a fixed and a free base.
#include "bench/problems.h"
#include "controller/ocp/ocp_reach.h"
#include "tables/panda_reach/task.h"
#include "tables/talos/robot.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

namespace engram {
namespace {

using Talos = robots::Talos;
using Flight = Ocp<Talos, FramePlacementTerm<Talos, 0>, FramePoseTerm<Talos, 1>, StateTerm<Talos>, ControlTerm<Talos, true>, LimitTerm<Talos>>;
using PandaReach = Reach<tasks::PandaReach>;
using Arm = bench::Arm;

std::mt19937 rng(1);
double uniform() { return std::uniform_real_distribution<double>(-1, 1)(rng); }

// Central differences err by h^2 f'''/6 + eps f / h: with h = 1e-5 on values and derivatives of order 1 to 1e3, 1e-6 relative.
constexpr double kStep = 1e-5, kTolerance = 2e-6;

template <class P> void random_state(double* x, double* u) {
  using R = typename P::R;
  double dx[P::Layout::nxp] = {}, home[P::nx] = {};
  for (int i = 0; i < P::nq; ++i) home[i] = R::q_home[i];
  for (int i = 0; i < P::ndx; ++i) dx[padded_index<typename P::Layout>(i)] = 0.4 * uniform();
  P::integrate(home, dx, x);
  for (int i = 0; i < P::nu; ++i) u[i] = 20 * uniform();
}

// x (+) h e_z, u + h e_z for coordinate z of (q, v, u).
template <class P> void moved(const double* x, const double* u, int z, double h, double* xz, double* uz) {
  double dx[P::Layout::nxp] = {};
  std::copy(u, u + P::nu, uz);
  if (z < P::ndx) dx[padded_index<typename P::Layout>(z)] = h;
  else uz[z - P::ndx] += h;
  P::integrate(x, dx, xz);
}

template <class P> void expect_derivatives(const typename P::template Knot<double>& knot, const double* x, const double* u, bool hessian) {
  using L = typename P::Layout;
  static typename P::template Model<double> M, Mp, Mm;
  double next[P::nx], cost;
  P::linearize(knot, x, u, next, cost, M);
  double check[P::nx], check_cost;
  P::calc(knot, x, u, check, check_cost);
  EXPECT_NEAR(cost, check_cost, 1e-12 * (1 + std::fabs(cost)));
  for (int i = 0; i < P::nx; ++i) EXPECT_NEAR(next[i], check[i], 1e-12);

  for (int z = 0; z < P::nz; ++z) {
    double xp[P::nx], xm[P::nx], up[P::nu], um[P::nu], next_p[P::nx], next_m[P::nx], dp[L::nxp], dm[L::nxp], cost_p, cost_m;
    moved<P>(x, u, z, kStep, xp, up);
    moved<P>(x, u, z, -kStep, xm, um);
    P::linearize(knot, xp, up, next_p, cost_p, Mp);
    P::linearize(knot, xm, um, next_m, cost_m, Mm);
    const int pz = padded_index<L>(z);
    const double gradient = (cost_p - cost_m) / (2 * kStep);
    EXPECT_NEAR(M.Lz[pz], gradient, kTolerance * (1 + std::fabs(cost) + std::fabs(gradient))) << "Lz " << z;
    P::difference(next, next_p, dp);
    P::difference(next, next_m, dm);
    for (int i = 0; i < P::nv; ++i) {
      const double dv = (dp[L::ov + i] - dm[L::ov + i]) / (2 * kStep), dq = (dp[i] - dm[i]) / (2 * kStep);
      EXPECT_NEAR(M.D[i][pz], dv, kTolerance * (1 + std::fabs(dv))) << "D " << i << " " << z;
      // dq' = E dq + dt G dv'
      double expected = 0;
      if constexpr (P::kFreeBase) {
        if (i < 6) {
          if (z < 6) expected += M.E(i, z);
          for (int k = 0; k < 6; ++k) expected += knot.dt * M.G(i, k) * M.D[k][pz];
        }
      }
      if (!P::kFreeBase || i >= 6) expected = (z == i ? 1.0 : 0.0) + knot.dt * M.D[i][pz];
      EXPECT_NEAR(expected, dq, kTolerance * (1 + std::fabs(dq))) << "dq' " << i << " " << z;
    }
    if (hessian)  // exact where the residuals are linear
      for (int y = 0; y <= z; ++y) {
        const double second = (Mp.Lz[padded_index<L>(y)] - Mm.Lz[padded_index<L>(y)]) / (2 * kStep);
        EXPECT_NEAR(M.Lzz[pz][padded_index<L>(y)], second, kTolerance * (1 + std::fabs(second))) << "Lzz " << z << " " << y;
      }
  }
}

TEST(OcpLinearize, PandaReachMatchesCentralDifferences) {
  ReachTarget target;
  const double task[7] = {0.5, 0.1, 0.5, 1, 0.1, 0, 0.2};
  ASSERT_TRUE(reach_target(task, target));
  for (int n = 0; n < 10; ++n) {
    PandaReach::Knot<double> knot;
    reach_knot<tasks::PandaReach>(target, n % 2 ? 0.03 : 0.013, n % 3 ? 0.0 : 2.0, knot);
    double x[PandaReach::nx], u[PandaReach::nu];
    random_state<PandaReach>(x, u);
    expect_derivatives<PandaReach>(knot, x, u, false);
  }
}

TEST(OcpLinearize, LinearResidualsHaveAnExactHessian) {
  static Horizon<Arm, 1> h;
  bench::arm_horizon(1, robots::Panda::q_home, h);
  auto knot = h.knot[0];
  knot.placement_w = 0.0;
  double x[Arm::nx], u[Arm::nu];
  random_state<Arm>(x, u);
  expect_derivatives<Arm>(knot, x, u, true);
}

TEST(OcpLinearize, FreeBaseMatchesCentralDifferences) {
  for (int n = 0; n < 3; ++n) {
    Flight::Knot<double> knot = {};
    knot.dt = 0.02;
    knot.placement_w = 0.7;
    knot.pose_w_p = 0.4;
    knot.pose_w_R = 0.3;
    for (int i = 0; i < 3; ++i) knot.placement_R[4 * i] = knot.pose_R[4 * i] = 1.0;
    for (int i = 0; i < Flight::ndx; ++i) knot.state_w[i] = 0.1 + 0.01 * i;
    for (int i = 0; i < Flight::nq; ++i) knot.state_ref[i] = Talos::q_home[i];
    knot.control_w = 1e-3;
    knot.limit_w_q = knot.limit_w_v = 1.0;
    double x[Flight::nx], u[Flight::nu];
    random_state<Flight>(x, u);
    expect_derivatives<Flight>(knot, x, u, false);
  }
}

// A lane computes what the scalar would, up to the compiler's choice of fused multiply-adds: some hundred roundings, amplified
// by the condition of the mass matrix (about 1e3).
constexpr double kRounding = 1e-11;
void expect_same(double scalar, double lane) { EXPECT_NEAR(scalar, lane, kRounding * (1 + std::fabs(scalar))); }

TEST(OcpLinearize, LanesEqualScalars) {
  ReachTarget target;
  const double task[7] = {0.5, 0.1, 0.5, 1, 0.1, 0, 0.2};
  ASSERT_TRUE(reach_target(task, target));
  static PandaReach::Model<Pack> lanes;
  static PandaReach::Model<double> one;
  PandaReach::Knot<double> knot;
  PandaReach::Knot<Pack> knots;
  reach_knot<tasks::PandaReach>(target, 0.03, 0.0, knot);
  const double* from = reinterpret_cast<const double*>(&knot);
  for (size_t i = 0; i < sizeof(knot) / sizeof(double); ++i) reinterpret_cast<Pack*>(&knots)[i] = from[i];
  double x[kLanes][PandaReach::nx], u[kLanes][PandaReach::nu], next[PandaReach::nx], cost;
  Pack xs[PandaReach::nx], us[PandaReach::nu], nexts[PandaReach::nx], costs;
  for (int l = 0; l < kLanes; ++l) {
    random_state<PandaReach>(x[l], u[l]);
    for (int i = 0; i < PandaReach::nx; ++i) xs[i].set(l, x[l][i]);
    for (int i = 0; i < PandaReach::nu; ++i) us[i].set(l, u[l][i]);
  }
  PandaReach::linearize(knots, xs, us, nexts, costs, lanes);
  for (int l = 0; l < kLanes; ++l) {
    PandaReach::linearize(knot, x[l], u[l], next, cost, one);
    expect_same(cost, costs[l]);
    for (int i = 0; i < PandaReach::nx; ++i) expect_same(next[i], nexts[i][l]);
    for (int i = 0; i < PandaReach::Layout::nzp; ++i) {
      expect_same(one.Lz[i], lanes.Lz[i][l]);
      for (int j = 0; j <= i; ++j) expect_same(one.Lzz[i][j], lanes.Lzz[i][j][l]);
    }
    for (int i = 0; i < PandaReach::nv; ++i)
      for (int j = 0; j < PandaReach::Layout::nzp; ++j) expect_same(one.D[i][j], lanes.D[i][j][l]);
  }
}

// Signed distance and gradient of a box and of a grid sampled from it.
struct OneBox {
  static constexpr int nbox = 1;
  static constexpr double p_WO[1][3] = {{0.1, -0.2, 0.3}};
  static constexpr double R_WO[1][9] = {{0.8, -0.6, 0.0, 0.6, 0.8, 0.0, 0.0, 0.0, 1.0}};
  static constexpr double half[1][3] = {{0.3, 0.2, 0.1}};
};
struct Grid {
  static constexpr int nx = 41, ny = 41, nz = 41;
  static constexpr double origin[3] = {-1.0, -1.0, -1.0}, cell = 0.05;
  static float sdf[nx * ny * nz];
};
float Grid::sdf[Grid::nx * Grid::ny * Grid::nz];

TEST(OcpObstacles, BoxDistanceHasItsGradient) {
  for (int n = 0; n < 1000; ++n) {
    const Vec3<double> p(uniform(), uniform(), uniform());
    Vec3<double> g, ignored;
    const double d = BoxField<OneBox>::distance(0, p, g);
    EXPECT_NEAR(g.norm(), 1.0, 1e-12);
    // one step along the gradient raises the distance by the step, except across an edge of the medial axis
    if (d > 1e-3) {
      const Vec3<double> step = 1e-3 * g, q = p + step;
      EXPECT_NEAR(BoxField<OneBox>::distance(0, q, ignored), d + 1e-3, 1e-12);
    }
  }
  Vec3<double> g;
  EXPECT_NEAR(BoxField<OneBox>::distance(0, Vec3<double>(0.1, -0.2, 0.3), g), -0.1, 1e-15);  // centre: the nearest face is z
}

// What is called far is, in every lane; and most of what is far is called so.
TEST(OcpObstacles, FarBoxesAreFar) {
  const Pack reach = 0.2;
  int all_far = 0, called_far = 0;
  for (int n = 0; n < 1000; ++n) {
    Vec3<Pack> p, g;
    for (int l = 0; l < kLanes; ++l)
      for (int i = 0; i < 3; ++i) p[i].set(l, uniform());
    const Pack d = BoxField<OneBox>::distance(0, p, g);
    double least = HUGE_VAL;
    for (int l = 0; l < kLanes; ++l) least = std::min(least, d[l]);
    const bool far = BoxField<OneBox>::far(0, p, reach);
    EXPECT_TRUE(!far || least >= 0.2 - 1e-12);
    all_far += least >= 0.2;
    called_far += far;
  }
  EXPECT_GT(called_far, all_far / 2);
  EXPECT_GT(called_far, 0);
}

TEST(OcpObstacles, GridInterpolatesTheBox) {
  Vec3<double> g;
  for (int k = 0; k < Grid::nz; ++k)
    for (int j = 0; j < Grid::ny; ++j)
      for (int i = 0; i < Grid::nx; ++i) {
        const Vec3<double> p(Grid::origin[0] + i * Grid::cell, Grid::origin[1] + j * Grid::cell, Grid::origin[2] + k * Grid::cell);
        Grid::sdf[i + Grid::nx * (j + Grid::ny * k)] = static_cast<float>(BoxField<OneBox>::distance(0, p, g));
      }
  for (int n = 0; n < 1000; ++n) {
    const Vec3<double> p(0.9 * uniform(), 0.9 * uniform(), 0.9 * uniform());
    Vec3<double> gg, unused;
    const double d = GridField<Grid>::distance(0, p, gg);
    // a distance is 1-Lipschitz: trilinear interpolation errs by at most the cell's half diagonal
    EXPECT_NEAR(d, BoxField<OneBox>::distance(0, p, g), 0.5 * std::sqrt(3.0) * Grid::cell);
    for (int k = 0; k < 3; ++k) {
      const double cell = (p[k] - Grid::origin[k]) / Grid::cell;
      if (std::fabs(cell - std::round(cell)) < 1e-4) continue;  // the gradient jumps between cells
      Vec3<double> a = p, b = p;
      a[k] += 1e-7;
      b[k] -= 1e-7;
      const double slope = (GridField<Grid>::distance(0, a, unused) - GridField<Grid>::distance(0, b, unused)) / 2e-7;
      EXPECT_NEAR(gg[k], slope, 1e-6);  // exact within a cell; float nodes round equally on both sides
    }
  }
  const Vec3<Pack> far(Pack(1e9), Pack(-1e9), Pack(std::nan("")));
  Vec3<Pack> gradient;
  EXPECT_TRUE(std::isfinite(GridField<Grid>::distance(0, far, gradient)[0]));
}

}  // namespace
}  // namespace engram
