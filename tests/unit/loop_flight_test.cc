// The lower rungs of a craft on thrusters: hovering is an equilibrium, a tumble is caught, a place is kept.
#include "controller/loop/loop_flight.h"
#include "tables/hector/robot.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace engram {
namespace {

using P = Ocp<robots::Hector, StateTerm<robots::Hector>>;
constexpr double kStep = 1e-3;  // s

// Flies under a law for some seconds; thrusts are clamped as the fast side clamps them.
template <class Law> void fly(double seconds, double* x, Law law) {
  P::Knot<double> knot = {};
  knot.dt = kStep;
  for (int i = 0; i < std::lround(seconds / kStep); ++i) {
    double u[P::nu], next[P::nx], cost;
    law(x, x + P::nq, u);
    for (int k = 0; k < P::nu; ++k) u[k] = std::clamp(u[k], P::u_lo(k), P::u_hi(k));
    P::calc(knot, x, u, next, cost);
    std::copy(next, next + P::nx, x);
  }
}

double speed(const double* x) {
  double most = 0.0;
  for (int i = P::nq; i < P::nx; ++i) most = std::max(most, std::fabs(x[i]));
  return most;
}

TEST(HoverHold, AtRestEveryThrusterCarriesAQuarterOfTheWeight) {
  const double x[P::nx] = {1, 2, 3, 0, 0, std::sin(0.4), std::cos(0.4)};
  HoverHold<P> hover;
  hover.begin(10.0, x);
  double u[P::nu];
  hover.hold(x, x + P::nq, u);
  for (double thrust : u) EXPECT_NEAR(thrust, 0.25 * 1.477 * 9.81, 1e-12);
  hover.damp(x, x + P::nq, u);
  for (double thrust : u) EXPECT_NEAR(thrust, 0.25 * 1.477 * 9.81, 1e-12);
}

TEST(HoverHold, KeepsPlaceAndHeading) {
  double x[P::nx] = {0, 0, 0, 0, 0, std::sin(0.4), std::cos(0.4)};
  HoverHold<P> hover;
  hover.begin(10.0, x);
  x[0] = 0.5, x[1] = -0.4, x[2] = 0.3, x[5] = 0.0, x[6] = 1.0;  // blown away, and turned by 0.8 rad
  fly(8.0, x, [&](const double* q, const double* v, double* u) { hover.hold(q, v, u); });
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(x[i], 0.0, 1e-3);  // e^(-2 rad/s 8 s) of half a metre, times its polynomial
  EXPECT_NEAR(x[5], std::sin(0.4), 1e-3);
  EXPECT_LT(speed(x), 1e-2);
}

TEST(HoverHold, CatchesATumble) {
  // 80 degrees over, turning about all axes, falling
  double x[P::nx] = {0, 0, 50, std::sin(0.7), 0, 0, std::cos(0.7), 2, -1, -3, 4, -3, 2};
  HoverHold<P> hover;
  fly(6.0, x, [&](const double* q, const double* v, double* u) { hover.damp(q, v, u); });
  EXPECT_LT(speed(x), 0.05);
  EXPECT_LT(std::hypot(x[3], x[4]), 0.01);  // upright
}

}  // namespace
}  // namespace engram
