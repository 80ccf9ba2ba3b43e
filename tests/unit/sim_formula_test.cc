// link: engram_sim
// The CVODE plant of formulas: the controller's own formula in ever smaller steps, MuJoCo on the same bodies, and pushes from outside.
#include "controller/ocp/ocp_systems.h"
#include "sim_harness/sim_formula.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace engram::sim {
namespace {

constexpr const char* kScenes[] = {"tables/pendulum_swing/scene.xml", "tables/unicycle_park/scene.xml", "tables/bicopter_fly/scene.xml"};

// Ten milliseconds under one control from a state that moves.
template <class S> void expect_the_same_motion(const char* scene) {
  Model model;
  ASSERT_EQ(model.load(scene), "");
  Formula formula;
  ASSERT_EQ(formula.init(model), "");
  double q[3] = {0.3, -0.4, 0.7}, v[3] = {0.5, 0.6, -0.8}, u[2];
  for (int i = 0; i < S::nu; ++i) u[i] = 0.7 * S::u_hi[i] - 0.1 * i;
  model.set_state(q, v);
  model.set_tau(u);
  for (int i = 0; i < 10; ++i) ASSERT_EQ(formula.step(&model), "");
  constexpr int kSteps = 10000;
  constexpr double dt = 0.01 / kSteps;
  for (int k = 0; k < kSteps; ++k) {
    double next[3];
    S::step(dt, q, v, u, next);
    for (int i = 0; i < S::n; ++i) {
      q[i] += dt * next[i];
      v[i] = next[i];
    }
  }
  for (int i = 0; i < S::n; ++i) {  // the steps' own error: 1 us, accelerations of 20 over 10 ms
    EXPECT_NEAR(model.d->qpos[i], q[i], 2e-7) << scene;
    EXPECT_NEAR(model.d->qvel[i], v[i], 2e-5) << scene;
  }
}

TEST(SimFormula, IsThatOfTheController) {
  expect_the_same_motion<Pendulum>(kScenes[0]);
  expect_the_same_motion<Unicycle>(kScenes[1]);
  expect_the_same_motion<Bicopter>(kScenes[2]);
}

// The bodies of the scene, left to themselves and pushed, accelerate as the formula without its controls says (slides weigh 1e-6 kg).
TEST(SimFormula, PushesAreThoseOfMujocosBodies) {
  for (const char* scene : {kScenes[0], kScenes[2]}) {
    Model model;
    ASSERT_EQ(model.load(scene), "");
    Formula formula;
    ASSERT_EQ(formula.init(model), "");
    const double q[3] = {0.3, -0.4, 0.7}, v[3] = {}, u[2] = {};
    model.set_state(q, v);
    model.set_tau(u);
    const double wrench[6] = {1.0, 0.5, -0.7, 0.1, -0.2, 0.3};
    mju_copy(model.d->xfrc_applied + 6 * (model.m->nbody - 2), wrench, 6);  // the last body is the target, or the only one
    if (model.nq == 1) mju_copy(model.d->xfrc_applied + 6, wrench, 6);
    mj_forward(model.m, model.d);
    double a[3];
    std::copy(model.d->qacc, model.d->qacc + model.nv, a);
    ASSERT_EQ(formula.step(&model), "");
    const double h = model.m->opt.timestep;
    for (int i = 0; i < model.nv; ++i) EXPECT_NEAR(model.d->qvel[i] / h, a[i], 1e-2) << scene << i;  // of 10, over 1 ms of motion
  }
}

TEST(SimFormula, ControlsAreKeptWithinTheirRanges) {
  Model model;
  ASSERT_EQ(model.load(kScenes[1]), "");
  Formula formula;
  ASSERT_EQ(formula.init(model), "");
  const double q[3] = {}, v[3] = {}, u[2] = {100.0, 0.0};
  model.set_state(q, v);
  model.set_tau(u);
  ASSERT_EQ(formula.step(&model), "");
  EXPECT_NEAR(model.d->qpos[0], 2.0 * model.m->opt.timestep, 1e-12);
  EXPECT_EQ(model.d->qvel[0], 2.0);
}

TEST(SimFormula, OtherScenesAreRefused) {
  Model hector;
  ASSERT_EQ(hector.load("tables/hector_fly/scene.xml"), "");
  hector.formula = "bicopter";
  EXPECT_NE(Formula().init(hector).find("are not those of the formula 'bicopter'"), std::string::npos);
  hector.formula = "tricopter";
  EXPECT_NE(Formula().init(hector).find("there is no formula 'tricopter'"), std::string::npos);
}

}  // namespace
}  // namespace engram::sim
