// link: engram_sim
// The CVODE plant of a flying body: closed forms, conservation laws, and MuJoCo on the same scene in small steps.
#include "sim_harness/sim_flight.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>

namespace engram::sim {
namespace {

constexpr char kScene[] = "tables/hector_fly/scene.xml";

// A body whose centre of mass and principal axes are off its frame.
constexpr char kSkewed[] = R"(<mujoco><compiler inertiafromgeom="false"/><option timestep="0.001"/>
  <worldbody><body name="b"><joint type="free"/>
    <inertial mass="2" pos="0.1 -0.05 0.02" quat="0.9 0.1 0.3 0.2" diaginertia="0.01 0.02 0.025"/>
    <site name="a" pos="0.2 0 0.1" quat="0.8 0 0.6 0"/><site name="c" pos="-0.2 0.1 0"/></body></worldbody>
  <actuator><motor site="a" gear="0 0 1 0 0 0.1" ctrllimited="true" ctrlrange="0 20"/>
    <motor site="c" gear="0 0 1 0 0 -0.1" ctrllimited="true" ctrlrange="0 20"/></actuator></mujoco>)";

std::string skewed_scene() {
  const std::string path = ::testing::TempDir() + std::to_string(getpid()) + "sim_flight_test.xml";
  std::FILE* file = std::fopen(path.c_str(), "w");
  std::fputs(kSkewed, file);
  std::fclose(file);
  return path;
}

TEST(SimFlight, ThrustAlongTheVerticalGivesAParabola) {
  Model model;
  ASSERT_EQ(model.load(kScene), "");
  Flight flight;
  ASSERT_EQ(flight.init(model), "");
  const double q[7] = {0, 0, 0, 0, 0, 0, 1}, v[6] = {1, 0, 0, 0, 0, 0}, tau[4] = {4, 4, 4, 4};
  model.set_state(q, v);
  model.set_tau(tau);
  model.d->xfrc_applied[6 + 1] = 3.0;  // N, along y
  for (int i = 0; i < 500; ++i) ASSERT_EQ(flight.step(&model), "");
  const double m = 1.477, t = 0.5, most = 2 * 500 * Flight::kTolerance;  // every step may err by the tolerance
  EXPECT_NEAR(model.d->qpos[0], t, most);
  EXPECT_NEAR(model.d->qpos[1], 0.5 * 3.0 / m * t * t, most);
  EXPECT_NEAR(model.d->qpos[2], 0.5 * (16.0 / m - 9.81) * t * t, most);
}

// Without thrust and gravity the angular momentum in world axes and the energy stay: tolerances of the integrator, 1000 steps.
TEST(SimFlight, TumblingKeepsItsMomentumAndEnergy) {
  Model model;
  ASSERT_EQ(model.load(skewed_scene().c_str()), "");
  mju_zero3(model.m->opt.gravity);
  Flight flight;
  ASSERT_EQ(flight.init(model), "");
  const double q[7] = {0, 0, 0, 0.1, 0.2, 0.3, std::sqrt(1 - 0.14)}, v[6] = {0.3, -0.2, 0.1, 3, -4, 5};
  model.set_state(q, v);
  const auto momentum = [&](double* L) {
    mj_forward(model.m, model.d);
    mj_subtreeVel(model.m, model.d);
    mju_copy3(L, model.d->subtree_angmom + 3);
  };
  model.m->opt.enableflags |= mjENBL_ENERGY;
  double before[3], after[3];
  momentum(before);
  const double energy = model.d->energy[1];
  for (int i = 0; i < 1000; ++i) ASSERT_EQ(flight.step(&model), "");
  momentum(after);
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(after[i], before[i], 1e-8);
  EXPECT_NEAR(model.d->energy[1], energy, 1e-8 * energy);
}

// MuJoCo's Runge-Kutta at a twentieth of the step is the same motion: thrusters, skewed inertia, an outer wrench. Its increments of
// rotation do not commute and leave it of order 2: 200 ms at 50 us and some 10 rad/s err by 1e-7.
TEST(SimFlight, AgreesWithMujocoInSmallSteps) {
  Model a, b;
  for (Model* model : {&a, &b}) {
    ASSERT_EQ(model->load(skewed_scene().c_str()), "");
    const double q[7] = {0, 0, 1, 0.1, 0.2, 0.3, std::sqrt(1 - 0.14)}, v[6] = {0.3, -0.2, 0.1, 1, -2, 0.5}, tau[2] = {1.0, 0.8};
    model->set_state(q, v);
    model->set_tau(tau);
    const double wrench[6] = {1, -2, 0.5, 0.02, 0.01, -0.03};
    mju_copy(model->d->xfrc_applied + 6, wrench, 6);
  }
  Flight flight;
  ASSERT_EQ(flight.init(a), "");
  for (int i = 0; i < 200; ++i) ASSERT_EQ(flight.step(&a), "");
  b.m->opt.integrator = mjINT_RK4;
  b.m->opt.timestep = 5e-5;
  for (int i = 0; i < 4000; ++i) mj_step(b.m, b.d);
  for (int i = 0; i < 7; ++i) EXPECT_NEAR(a.d->qpos[i], b.d->qpos[i], 1e-7);
  for (int i = 0; i < 6; ++i) EXPECT_NEAR(a.d->qvel[i], b.d->qvel[i], 1e-6);
}

TEST(SimFlight, OtherScenesAreRefused) {
  Model model;
  ASSERT_EQ(model.load("tables/anymal_trot/scene.xml"), "");
  Flight flight;
  EXPECT_NE(flight.init(model).find("one free body on thrusters"), std::string::npos);
}

}  // namespace
}  // namespace engram::sim
