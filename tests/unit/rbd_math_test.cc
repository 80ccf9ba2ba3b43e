// Branch-free elementary functions against libm in long double.
#include <gtest/gtest.h>

#include "controller/rbd/rbd_math.h"
#include "tests/unit/rbd_test_robots.h"

namespace engram::test {
namespace {

double ulp_of(double x) { return std::nextafter(std::fabs(x), INFINITY) - std::fabs(x); }

TEST(Math, SineAndCosineWithinOneUlpUpTo1e4) {
  Random random(5);
  double worst_s = 0, worst_c = 0;
  for (int i = 0; i < 200000; ++i) {
    const double a = random() * (i % 2 ? 1e4 : 4.0);
    double s, c;
    sincos(a, s, c);
    const long double exact_s = std::sin((long double)a), exact_c = std::cos((long double)a);
    worst_s = std::max(worst_s, (double(std::fabs(s - exact_s)) - 1e-21) / ulp_of(double(exact_s)));
    worst_c = std::max(worst_c, (double(std::fabs(c - exact_c)) - 1e-21) / ulp_of(double(exact_c)));
  }
  EXPECT_LT(worst_s, 1.0);
  EXPECT_LT(worst_c, 1.0);
}

TEST(Math, SineAndCosineAtSpecialAngles) {
  double s, c;
  sincos(0.0, s, c);
  EXPECT_EQ(s, 0.0);
  EXPECT_EQ(c, 1.0);
  for (int quarter = -8; quarter <= 8; ++quarter) {
    const double a = quarter * 1.57079632679489661923;
    sincos(a, s, c);
    EXPECT_NEAR(s, std::sin(a), 1e-21);  // the zeros too
    EXPECT_NEAR(c, std::cos(a), 1e-21);
  }
  sincos(std::nan(""), s, c);
  EXPECT_TRUE(std::isnan(s) && std::isnan(c));
}

TEST(Math, ArcTangentOfTheFirstQuadrant) {
  Random random(6);
  for (int i = 0; i < 100000; ++i) {
    const double y = std::fabs(random()) * std::pow(10.0, 8 * random()), x = std::fabs(random());
    double per_y;
    const double angle = atan2_first_quadrant(y, x, per_y), exact = std::atan2(y, x);
    EXPECT_NEAR(angle, exact, 2 * ulp_of(exact));
    EXPECT_NEAR(per_y, exact / y, 4 * ulp_of(exact / y));
  }
  double per_y;
  EXPECT_EQ(atan2_first_quadrant(0.0, 2.0, per_y), 0.0);
  EXPECT_EQ(per_y, 0.5);
  EXPECT_EQ(atan2_first_quadrant(3.0, 0.0, per_y), std::atan2(3.0, 0.0));
}

TEST(Math, PackComparesSelectsAndTakesRootsLaneByLane) {
  Pack a, b;
  for (int l = 0; l < kLanes; ++l) {
    a.set(l, l - 1.5);
    b.set(l, 0.25 * l);
  }
  for (int l = 0; l < kLanes; ++l) {
    EXPECT_EQ(select(a < b, a, b)[l], std::min(a[l], b[l]));
    EXPECT_EQ(max(a, b)[l], std::max(a[l], b[l]));
    EXPECT_EQ(abs(a)[l], std::fabs(a[l]));
    EXPECT_EQ(sqrt(b)[l], std::sqrt(b[l]));
    EXPECT_EQ(madd(a, b, b)[l], std::fma(a[l], b[l], b[l]));
  }
}

}  // namespace
}  // namespace engram::test
