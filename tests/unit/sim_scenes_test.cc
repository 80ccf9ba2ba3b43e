// link: engram_sim
// The generated scenes: the robot stands on the ground of its world, thrusters lift what they should.
#include "sim_harness/sim_model.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace engram::sim {
namespace {


// Puts the robot into its nominal posture (keyframe 0).
void load_home(const char* scene, Model* model) {
  ASSERT_EQ(model->load(scene), "");
  mj_resetDataKeyframe(model->m, model->d, 0);
  mj_forward(model->m, model->d);
}

// Weight of the robot [N].
double weight(const Model& model) { return -model.m->opt.gravity[2] * mj_getTotalmass(model.m); }

TEST(SimScenes, FeetTouchTheGroundInTheNominalPosture) {
  for (const char* scene : {"tables/talos_stand/scene.xml", "tables/anymal_trot/scene.xml"}) {
    Model model;
    load_home(scene, &model);
    EXPECT_EQ(model.m->opt.cone, mjCONE_ELLIPTIC) << scene;
    mjtNum lowest = 1e9;
    for (int g = 0; g < model.m->ngeom; ++g) {
      const bool ground = model.m->geom_type[g] == mjGEOM_PLANE;
      if (!ground) continue;
      for (int f = 0; f < model.m->ngeom; ++f) {
        if (model.m->geom_conaffinity[f] != 1) continue;
        const mjtNum* R = model.d->geom_xmat + 9 * f;
        const mjtNum* size = model.m->geom_size + 3 * f;
        const mjtNum reach = model.m->geom_type[f] == mjGEOM_SPHERE
                                 ? size[0]
                                 : std::fabs(R[6]) * size[0] + std::fabs(R[7]) * size[1] + std::fabs(R[8]) * size[2];
        lowest = std::min(lowest, model.d->geom_xpos[3 * f + 2] - reach - model.d->geom_xpos[3 * g + 2]);
      }
    }
    EXPECT_NEAR(lowest, 0.0, 1e-3) << scene;  // soles of Talos are turned by 2 mrad in its nominal posture
  }
}

TEST(SimScenes, FrictionIsThatOfTheGround) {
  Model model;
  load_home("tables/anymal_trot/scene.xml", &model);
  model.d->qpos[2] -= 1e-3;
  mj_forward(model.m, model.d);
  ASSERT_EQ(model.d->ncon, 4);
  for (int i = 0; i < 4; ++i) {
    EXPECT_DOUBLE_EQ(model.d->contact[i].friction[0], 0.8);
    EXPECT_EQ(model.d->contact[i].dim, 3);
  }
}

TEST(SimScenes, FourThrustersOfAQuarterOfTheWeightHover) {
  Model model;
  load_home("tables/hector_fly/scene.xml", &model);
  ASSERT_EQ(model.nthruster, 4);
  double tau[kMaxDof] = {};
  for (int i = 0; i < 4; ++i) tau[i] = 0.25 * weight(model);
  model.set_tau(tau);
  mj_forward(model.m, model.d);
  for (int i = 0; i < 6; ++i) EXPECT_NEAR(model.d->qacc[i], 0.0, 1e-9);
  tau[0] += 0.1;  // front: nose up (about -y), and turning against +z
  model.set_tau(tau);
  mj_forward(model.m, model.d);
  EXPECT_NEAR(model.d->qacc[4], -0.1525 * 0.1 / 0.01152, 1e-9);
  EXPECT_NEAR(model.d->qacc[5], -0.1 / 66 / 0.0218, 1e-9);
}

TEST(SimScenes, ShareIsOneAtBothEndsOfTheRange) {
  Model model;
  load_home("tables/hector_fly/scene.xml", &model);
  for (const double u : {0.0, 5.0}) {
    const double tau[kMaxDof] = {2.5, 2.5, u, 2.5};
    model.set_tau(tau);
    EXPECT_DOUBLE_EQ(model.torque_share(), 1.0);
  }
}

}  // namespace
}  // namespace engram::sim
