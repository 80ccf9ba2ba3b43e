// The warp: ends, blends, and a motion that the integrator of the problem reproduces.
#include "controller/memory/memory_warp.h"

#include "controller/ocp/ocp_reach.h"
#include "tables/panda_reach/task.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace engram {
namespace {

using Task = tasks::PandaReach;
using R = Task::Robot;
using P = Reach<Task>;
constexpr int N = Task::nknots, nq = R::nq, nv = R::nv;

TEST(Blend, MinimumJerkBoundaryConditions) {
  const double e = 1e-4;
  EXPECT_EQ(Blend(0).s, 0);
  EXPECT_EQ(Blend(1).s, 1);
  EXPECT_EQ(Blend(0).h, 0);
  EXPECT_NEAR(Blend(1).h, 0, 1e-15);
  EXPECT_NEAR(Blend(0.5).s, 0.5, 1e-15);
  // first and second derivatives at the ends by differences from inside, whose error is of the order of e
  const auto slope = [e](auto f, double at, double sign) { return sign * (f(at + sign * e) - f(at)) / e; };
  const auto curve = [e](auto f, double at, double sign) { return (f(at + 2 * sign * e) - 2 * f(at + sign * e) + f(at)) / (e * e); };
  const auto s = [](double r) { return Blend(r).s; };
  const auto h = [](double r) { return Blend(r).h; };
  EXPECT_NEAR(slope(s, 0, 1), 0, 1e-3);
  EXPECT_NEAR(slope(s, 1, -1), 0, 1e-3);
  EXPECT_NEAR(slope(h, 0, 1), 1, 1e-3);
  EXPECT_NEAR(slope(h, 1, -1), 0, 1e-3);
  for (double at : {0.0, 1.0}) {
    EXPECT_NEAR(curve(s, at, at == 0 ? 1 : -1), 0, 1e-2);
    EXPECT_NEAR(curve(h, at, at == 0 ? 1 : -1), 0, 1e-2);
  }
  EXPECT_EQ(Blend(-3).s, 0);
  EXPECT_EQ(Blend(7).s, 1);
}

struct Bent {
  double x0[nq + nv], end[nq], t[N + 1], path[N + 1][nq], bow[N + 1][nq];

  // A random bow that vanishes at its ends, from a moving start; a short first knot, as in a running controller.
  explicit Bent(int seed) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> uniform(-0.5, 0.5);
    for (double& e : x0) e = uniform(random);
    for (int i = 0; i < nq; ++i) {
      x0[i] += R::q_home[i];
      end[i] = R::q_home[i] + uniform(random);
    }
    const double first = 0.4 * Task::dt;
    for (int k = 0; k <= N; ++k) t[k] = k == 0 ? 0 : first + (k - 1) * Task::dt;
    double size[nq];
    for (double& s : size) s = uniform(random);
    for (int k = 0; k <= N; ++k) {
      for (int i = 0; i < nq; ++i) path[k][i] = bow[k][i] = size[i] * std::pow(std::sin(M_PI * t[k] / t[N]), 3);
    }
    warp_bow<R>(x0, end, N, t, t[N], path);
  }
};

TEST(Warp, StartsAtTheStateAndEndsAtTheGoal) {
  for (int seed = 0; seed < 20; ++seed) {
    const Bent b(seed);
    for (int i = 0; i < nq; ++i) {
      EXPECT_NEAR(b.path[0][i], b.x0[i], 1e-15);
      EXPECT_NEAR(b.path[N][i], b.end[i], 1e-14);
      EXPECT_NEAR((b.path[1][i] - b.path[0][i]) / b.t[1], b.x0[nq + i], 0.05);  // starts with v0, but for its acceleration times dt/2
    }
  }
}

TEST(Warp, EqualsTheRememberedMotionPlusFadedCorrections) {
  // a remembered motion q_m from rest and its bow; bent to other ends, the textbook formula of the warp
  const Bent b(3);
  double start_m[nq], end_m[nq];
  for (int i = 0; i < nq; ++i) {
    start_m[i] = b.x0[i] + 0.2;
    end_m[i] = b.end[i] - 0.3;
  }
  double x0[nq + nv] = {};
  for (int i = 0; i < nq; ++i) x0[i] = b.x0[i];
  double path[N + 1][nq];
  for (int k = 0; k <= N; ++k)
    for (int i = 0; i < nq; ++i) path[k][i] = b.bow[k][i];
  warp_bow<R>(x0, b.end, N, b.t, b.t[N], path);
  for (int k = 0; k <= N; ++k) {
    const double s = Blend(b.t[k] / b.t[N]).s;
    for (int i = 0; i < nq; ++i) {
      const double q_m = b.bow[k][i] + (1 - s) * start_m[i] + s * end_m[i];
      EXPECT_NEAR(path[k][i], q_m + (1 - s) * (x0[i] - start_m[i]) + s * (b.end[i] - end_m[i]), 1e-14);
    }
  }
}

TEST(Warp, TheMotionHasNoGaps) {
  for (int seed = 0; seed < 5; ++seed) {
    const Bent b(seed);
    double x[N + 1][P::nx], u[N][P::nu];
    RbdData<R, double> d;
    follow_path<R>(b.x0 + nq, N, b.t, b.path, d, [&](int k, const double* q, const double* v, const double* tau) {
      for (int i = 0; i < nq; ++i) x[k][i] = q[i];
      for (int i = 0; i < nv; ++i) x[k][nq + i] = v[i];
      for (int i = 0; tau != nullptr && i < nv; ++i) u[k][i] = tau[i];
      EXPECT_EQ(tau == nullptr, k == N);
    });
    ReachTarget target{{0.5, 0, 0.5}, {1, 0, 0, 0, -1, 0, 0, 0, -1}};
    P::Knot<double> knot;
    for (int k = 0; k < N; ++k) {
      reach_knot<Task>(target, b.t[k + 1] - b.t[k], b.t[k], knot);
      double x_next[P::nx], cost;
      P::calc(knot, x[k], u[k], x_next, cost);
      // forward dynamics undo inverse dynamics: condition of the mass matrix (about 1e3) times rounding times torques of 100 N m
      for (int i = 0; i < P::nx; ++i) EXPECT_NEAR(x_next[i], x[k + 1][i], 1e-10) << "knot " << k << " entry " << i;
    }
  }
}

TEST(Warp, LanesComputeWhatOneMotionDoes) {
  Pack path[N + 1][nq], end[nq];
  const Bent b(1);
  for (int l = 0; l < kLanes; ++l) {
    for (int i = 0; i < nq; ++i) end[i].l[l] = b.end[i] + 0.1 * l;
    for (int k = 0; k <= N; ++k)
      for (int i = 0; i < nq; ++i) path[k][i].l[l] = (1 + l) * b.bow[k][i];
  }
  warp_bow<R>(b.x0, end, N, b.t, b.t[N], path);
  RbdData<R, Pack> d_lanes;
  RbdData<R, double> d;
  Pack u_lanes[N][nv];
  follow_path<R>(b.x0 + nq, N, b.t, path, d_lanes, [&](int k, const Pack*, const Pack*, const Pack* u) {
    for (int i = 0; u != nullptr && i < nv; ++i) u_lanes[k][i] = u[i];
  });
  for (int l = 0; l < kLanes; ++l) {
    double one[N + 1][nq], one_end[nq];
    for (int i = 0; i < nq; ++i) one_end[i] = end[i].l[l];
    for (int k = 0; k <= N; ++k)
      for (int i = 0; i < nq; ++i) one[k][i] = (1 + l) * b.bow[k][i];
    warp_bow<R>(b.x0, one_end, N, b.t, b.t[N], one);
    follow_path<R>(b.x0 + nq, N, b.t, one, d, [&](int k, const double* q, const double*, const double* u) {
      for (int i = 0; i < nq; ++i) EXPECT_NEAR(q[i], path[k][i].l[l], 1e-15);
      for (int i = 0; u != nullptr && i < nv; ++i) EXPECT_NEAR(u[i], u_lanes[k][i].l[l], 1e-9);  // same operations, fused or not
    });
  }
}

}  // namespace
}  // namespace engram
