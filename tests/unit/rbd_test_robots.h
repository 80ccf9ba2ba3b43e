// Robots and random states for the tests of the rigid-body room.
#ifndef TESTS_UNIT_RBD_TEST_ROBOTS_H_
#define TESTS_UNIT_RBD_TEST_ROBOTS_H_

#include "controller/rbd/rbd_kinematics.h"
#include "tables/panda/robot.h"
#include "tables/talos/robot.h"

#include <cmath>
#include <random>

namespace engram::test {

// A tree with every joint kind, two branch points and turned joint frames, on a base of any kind:
//   0 base - 1 revolute - 2 prismatic - 3 revolute
//          |            ` 4 revolute
//          ` 5 prismatic - 6 revolute
template <JointKind base> struct Bush {
  static constexpr int extra_q = base == kFree ? 6 : 0, extra_v = base == kFree ? 5 : 0;
  static constexpr char name[] = "bush";
  static constexpr int nj = 7, nq = 7 + extra_q, nv = 7 + extra_v, nu = 6;
  static constexpr JointKind kind[nj] = {base, kRevolute, kPrismatic, kRevolute, kRevolute, kPrismatic, kRevolute};
  static constexpr int parent[nj] = {-1, 0, 1, 2, 1, 0, 5};
  static constexpr int iq[nj] = {0, 1 + extra_q, 2 + extra_q, 3 + extra_q, 4 + extra_q, 5 + extra_q, 6 + extra_q};
  static constexpr int iv[nj] = {0, 1 + extra_v, 2 + extra_v, 3 + extra_v, 4 + extra_v, 5 + extra_v, 6 + extra_v};
  static constexpr int nsub[nj] = {7, 4, 2, 1, 1, 2, 1};
  static constexpr double t = 1.0 / 3.0;
  static constexpr double R_PJ[nj][9] = {
      {0.6, -0.8, 0, 0.8, 0.6, 0, 0, 0, 1}, {2 * t, -t, 2 * t, 2 * t, 2 * t, -t, -t, 2 * t, 2 * t},
      {0, 0, 1, 1, 0, 0, 0, 1, 0},          {1, 0, 0, 0, 0.6, -0.8, 0, 0.8, 0.6},
      {0, -1, 0, 1, 0, 0, 0, 0, 1},         {-t, 2 * t, 2 * t, 2 * t, -t, 2 * t, 2 * t, 2 * t, -t},
      {0.8, 0, 0.6, 0, 1, 0, -0.6, 0, 0.8},
  };
  static constexpr double p_PJ[nj][3] = {{0.1, -0.2, 0.3}, {0.2, 0.1, 0.3},   {-0.1, 0.3, 0.05}, {0.25, 0, 0.1},
                                         {0, 0.15, -0.2},  {-0.3, 0.2, 0.15}, {0.1, 0.1, 0.4}};
  static constexpr double mass[nj] = {5.0, 2.5, 1.25, 0.75, 0.6, 1.5, 0.4};
  static constexpr double com[nj][3] = {{0.01, 0.02, 0.1}, {0.05, -0.03, 0.12}, {0, 0.07, -0.04}, {0.1, 0, 0.03},
                                        {-0.02, 0.06, 0},  {0.08, 0.01, 0.02},  {0, -0.05, 0.09}};
  static constexpr double inertia[nj][6] = {{0.3, 0.01, -0.02, 0.25, 0.03, 0.2},      {0.05, 0.002, 0.001, 0.04, -0.003, 0.03},
                                            {0.02, 0, 0.001, 0.015, 0.002, 0.01},     {0.006, 0.001, 0, 0.005, 0, 0.004},
                                            {0.005, -0.001, 0.0005, 0.004, 0, 0.003}, {0.02, 0.003, 0, 0.03, 0.004, 0.025},
                                            {0.003, 0, 0.0002, 0.002, -0.0004, 0.002}};
  static constexpr double armature[12] = {0, 0.1, 0, 0.02, 0, 0, 0.3, 0, 0.05, 0, 0.01, 0};
  static constexpr double gravity[3] = {0, 0, -9.81};
  enum Frame { kTip, kBase, nframe };
  static constexpr int frame_joint[nframe] = {3, 0};
  static constexpr double R_JF[nframe][9] = {{0, -1, 0, 1, 0, 0, 0, 0, 1}, {1, 0, 0, 0, 1, 0, 0, 0, 1}};
  static constexpr double p_JF[nframe][3] = {{0.1, 0.05, 0.2}, {0, 0, 0}};
};

using AllRobots = ::testing::Types<robots::Panda, robots::Talos, Bush<kPrismatic>, Bush<kFree>>;

// Uniform numbers in [-1, 1], from a fixed seed.
class Random {
 public:
  explicit Random(unsigned seed) : engine_(seed) {}
  double operator()() { return uniform_(engine_); }
  template <int n> Vec<double, n> vector() {
    Vec<double, n> x;
    for (int i = 0; i < n; ++i) x[i] = (*this)();
    return x;
  }
  // joints within 1 rad or 1 m of zero, any base orientation
  template <class R> Vec<double, R::nq> configuration() {
    Vec<double, R::nq> q = vector<R::nq>();
    if constexpr (R::kind[0] == kFree) q.template segment<4>(3).normalize();
    return q;
  }

 private:
  std::mt19937 engine_;
  std::uniform_real_distribution<double> uniform_{-1.0, 1.0};
};

// One lane of an array of Packs.
template <int n> inline Vec<double, n> lane_of(const Pack* x, int l) {
  Vec<double, n> y;
  for (int i = 0; i < n; ++i) y[i] = x[i][l];
  return y;
}

}  // namespace engram::test
#endif  // TESTS_UNIT_RBD_TEST_ROBOTS_H_
