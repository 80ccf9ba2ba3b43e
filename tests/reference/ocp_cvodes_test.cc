// link: engram_cvodes
// options: -Og
// The discrete step of every kind of problem against the exact flow (CVODES, tolerances 1e-12): semi-implicit Euler is of order 1, so
// the error of one step, in the state, in A and in B, falls by 4 when the step is halved.
#include "bench/legged_problems.h"
#include "bench/problems.h"
#include "controller/ocp/ocp_systems.h"
#include "tests/reference/cvodes_step.h"

#include <algorithm>
#include <random>

namespace engram {
namespace {

using bench::Arm;

constexpr double kStep = 1e-3;  // s
// log2 of the ratio of errors at h and h/2 is 2 + h c3 / (2 ln 2 c2), and c3 / c2 is at most some 1/(50 ms) here.
constexpr double kOrderTolerance = 0.02;

std::mt19937 rng(7);
double uniform() { return std::uniform_real_distribution<double>(-1, 1)(rng); }

struct Errors {
  double x = 0, A = 0, B = 0;
};

// What the discrete step misses of the exact one; rows and columns of v are left out for a system of first order.
template <class P, bool FirstOrder> Errors step_errors(CvodesStep<P, FirstOrder>& exact, const double* x, const double* u, double h) {
  using L = typename P::Layout;
  constexpr int n = FirstOrder ? P::nv : P::ndx;
  typename P::template Knot<double> knot = {};
  knot.dt = h;
  static typename P::template Model<double> M;
  double next[P::nx], exact_next[P::nx], cost, d[L::nxp];
  Eigen::Matrix<double, P::ndx, P::nz> exact_AB;
  P::linearize(knot, x, u, next, cost, M);
  exact.step(x, u, h, exact_next, &exact_AB);
  P::difference(next, exact_next, d);
  const Eigen::Matrix<double, P::ndx, P::nz> gap = dense_AB<P>(M, h) - exact_AB;
  Errors e;
  for (int i = 0; i < n; ++i) e.x = std::max(e.x, std::fabs(d[padded_index<L>(i)]));
  e.A = gap.topLeftCorner(n, n).cwiseAbs().maxCoeff();
  e.B = gap.topRightCorner(n, P::nu).cwiseAbs().maxCoeff();
  return e;
}

// Median over random states and controls of the order seen in each of x, A, B; printed beside the largest error.
template <class P, bool FirstOrder = false, class State> void expect_order_two_per_step(State random_state) {
  CvodesStep<P, FirstOrder> exact;
  std::vector<double> orders[3];
  double largest[3] = {};
  for (int n = 0; n < 9; ++n) {
    double x[P::nx], u[P::nu];
    random_state(x, u);
    const Errors a = step_errors(exact, x, u, kStep), b = step_errors(exact, x, u, 0.5 * kStep);
    const double pairs[3][2] = {{a.x, b.x}, {a.A, b.A}, {a.B, b.B}};
    for (int i = 0; i < 3; ++i) {
      orders[i].push_back(std::log2(pairs[i][0] / pairs[i][1]));
      largest[i] = std::max(largest[i], pairs[i][0]);
    }
  }
  const char* names[3] = {"state", "A", "B"};
  for (int i = 0; i < 3; ++i) {
    std::nth_element(orders[i].begin(), orders[i].begin() + 4, orders[i].end());
    EXPECT_NEAR(orders[i][4], 2.0, kOrderTolerance) << names[i];
    std::printf("  %-5s order of one step %.3f, error at %g s at most %.2e\n", names[i], orders[i][4], kStep, largest[i]);
  }
}

TEST(OcpCvodes, Arm) {
  expect_order_two_per_step<Arm>([](double* x, double* u) {
    for (int i = 0; i < 7; ++i) {
      x[i] = robots::Panda::q_home[i] + 0.5 * uniform();
      x[7 + i] = uniform();
      u[i] = 10 * uniform();
    }
  });
}

void random_flight(double* x, double* u) {
  Eigen::Quaterniond turn = Eigen::Quaterniond(uniform(), uniform(), uniform(), uniform()).normalized();
  for (int i = 0; i < 3; ++i) x[i] = uniform();
  x[3] = turn.x(), x[4] = turn.y(), x[5] = turn.z(), x[6] = turn.w();
  for (int i = 0; i < 6; ++i) x[7 + i] = 2 * uniform();
  for (int i = 0; i < 4; ++i) u[i] = 2.5 + 2.5 * uniform();
}
TEST(OcpCvodes, Quadrotor) { expect_order_two_per_step<bench::Hector>(random_flight); }

// Four feet on the ground: the forces of the contacts follow from the state, and the flow is as smooth as without them.
using Standing = InPhase<ContactOcp<bench::AnymalFeet, StateTerm<robots::Anymal>>, 15u>;
TEST(OcpCvodes, FourLeggedInContact) {
  expect_order_two_per_step<Standing>([](double* x, double* u) {
    double dx[Standing::Layout::nxp] = {}, home[Standing::nx] = {};
    std::copy(robots::Anymal::q_home, robots::Anymal::q_home + Standing::nq, home);
    for (int i = 0; i < Standing::ndx; ++i) dx[padded_index<Standing::Layout>(i)] = 0.2 * uniform();
    Standing::integrate(home, dx, x);
    for (int i = 0; i < Standing::nu; ++i) u[i] = 10 * uniform();
  });
}

template <class P> void random_system(double* x, double* u) {
  for (int i = 0; i < P::nx; ++i) x[i] = 2 * uniform();
  for (int i = 0; i < P::nu; ++i) u[i] = 0.5 * (P::u_lo(i) + P::u_hi(i)) + 0.5 * (P::u_hi(i) - P::u_lo(i)) * uniform();
}
TEST(OcpCvodes, Pendulum) { expect_order_two_per_step<AnalyticOcp<Pendulum>>(random_system<AnalyticOcp<Pendulum>>); }
TEST(OcpCvodes, Bicopter) { expect_order_two_per_step<AnalyticOcp<Bicopter>>(random_system<AnalyticOcp<Bicopter>>); }
TEST(OcpCvodes, Unicycle) { expect_order_two_per_step<AnalyticOcp<Unicycle>, true>(random_system<AnalyticOcp<Unicycle>>); }

// The oracle itself: thrust along the vertical gives a parabola, and sensitivities agree with differences of flows.
TEST(OcpCvodes, OracleKnowsTheParabola) {
  using P = bench::Hector;
  CvodesStep<P> exact;
  const double x[P::nx] = {0, 0, 1, 0, 0, 0, 1, 0.3, 0, 2, 0, 0, 0}, u[4] = {4, 4, 4, 4}, h = 0.5;
  double next[P::nx];
  Eigen::Matrix<double, P::ndx, P::nz> AB;
  exact.step(x, u, h, next, &AB);
  const double a = 16.0 / robots::Hector::mass[0] + robots::Hector::gravity[2];
  EXPECT_NEAR(next[0], 0.3 * h, 1e-12);
  EXPECT_NEAR(next[2], 1 + 2 * h + 0.5 * a * h * h, 1e-12);
  EXPECT_NEAR(next[9], 2 + a * h, 1e-12);
  EXPECT_NEAR(AB(2, P::ndx), 0.5 * h * h / robots::Hector::mass[0], 1e-11);
}

TEST(OcpCvodes, OraclesSensitivitiesAreDifferencesOfFlows) {
  using P = bench::Hector;
  using L = P::Layout;
  CvodesStep<P> exact;
  double x[P::nx], u[P::nu], next[P::nx];
  random_flight(x, u);
  Eigen::Matrix<double, P::ndx, P::nz> AB, unused;
  exact.step(x, u, 0.1, next, &AB);
  constexpr double h = 1e-4;  // central differences err by h^2 f'''/6 and 1e-12 / h: 1e-8
  for (int j = 0; j < P::nz; ++j) {
    double end[2][P::nx], d[L::nxp] = {};
    for (int side = 0; side < 2; ++side) {
      double from[P::nx], control[P::nu];
      std::fill(d, d + L::nxp, 0.0);
      std::copy(u, u + P::nu, control);
      if (j < P::ndx) d[padded_index<L>(j)] = side ? -h : h;
      else control[j - P::ndx] += side ? -h : h;
      P::integrate(x, d, from);
      exact.step(from, control, 0.1, end[side], &unused);
    }
    P::difference(end[1], end[0], d);
    for (int i = 0; i < P::ndx; ++i) EXPECT_NEAR(d[padded_index<L>(i)] / (2 * h), AB(i, j), 3e-8) << i << " by " << j;
  }
}

}  // namespace
}  // namespace engram
