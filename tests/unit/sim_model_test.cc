// link: engram_sim
// Conventions of the messages against MuJoCo's, and what the judge measures, by hand.
#include "sim_harness/sim_model.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <string>

#include "sim_harness/sim_judge.h"

namespace engram::sim {
namespace {

constexpr char kFloating[] = R"(<mujoco>
  <compiler angle="radian"/>
  <worldbody>
    <geom name="ground" type="plane" size="1 1 0.1"/>
    <body name="base" pos="0 0 1">
      <freejoint/>
      <geom name="trunk" type="box" size="0.2 0.1 0.05" mass="3"/>
      <body name="leg" pos="0.1 0 0">
        <joint name="hip" axis="0 1 0" limited="true" range="-1 1"/>
        <geom type="sphere" size="0.05" pos="0 0 -0.3" mass="1"/>
        <site name="foot" pos="0 0 -0.3"/>
      </body>
    </body>
  </worldbody>
  <actuator><motor joint="hip" ctrllimited="true" ctrlrange="-10 10"/></actuator>
</mujoco>)";

class SimModel : public ::testing::Test {
 protected:
  void SetUp() override {
    const std::string path = ::testing::TempDir() + "sim_model_test.xml";
    std::FILE* file = std::fopen(path.c_str(), "w");
    ASSERT_NE(file, nullptr);
    std::fputs(kFloating, file);
    std::fclose(file);
    ASSERT_EQ(model.load(path.c_str()), "");
    ASSERT_EQ(model.select_hand("foot"), "");
  }
  Model model;
};

TEST_F(SimModel, QuaternionIsLastFirst) {
  const double s = std::sqrt(0.5);
  const double q[8] = {1, 2, 3, 0, 0, s, s, 0.5}, v[7] = {};  // turned by 90 degrees about z
  model.set_state(q, v);
  EXPECT_DOUBLE_EQ(model.d->qpos[3], s);
  EXPECT_DOUBLE_EQ(model.d->qpos[6], s);
  double q_back[8], v_back[7];
  model.get_state(q_back, v_back);
  for (int i = 0; i < 8; ++i) EXPECT_DOUBLE_EQ(q_back[i], q[i]);
}

TEST_F(SimModel, BaseVelocityIsInBodyAxes) {
  const double s = std::sqrt(0.5);
  // x of the body is y of the world; moving along it, and turning about it
  const double q[8] = {0, 0, 1, 0, 0, s, s, 0}, v[7] = {1, 0, 0, 2, 0, 0, 0.3};
  model.set_state(q, v);
  EXPECT_NEAR(model.d->qvel[0], 0, 1e-15);
  EXPECT_NEAR(model.d->qvel[1], 1, 1e-15);
  EXPECT_DOUBLE_EQ(model.d->qvel[3], 2);  // MuJoCo's own angular velocity is in body axes
  double q_back[8], v_back[7];
  model.get_state(q_back, v_back);
  for (int i = 0; i < 7; ++i) EXPECT_NEAR(v_back[i], v[i], 1e-15);  // two rotations: rounding
  mj_forward(model.m, model.d);
  double world[6];  // MuJoCo: angular, then linear
  mj_objectVelocity(model.m, model.d, mjOBJ_XBODY, mj_name2id(model.m, mjOBJ_BODY, "base"), world, 0);
  EXPECT_NEAR(world[1], 2, 1e-12);
  EXPECT_NEAR(world[4], 1, 1e-12);
}

TEST_F(SimModel, PoseErrors) {
  const double half = 0.5 * 0.02;
  const Pose a{{0, 0, 0}, {0, 0, 0, 1}}, b{{0.3, 0, 0.4}, {0, std::sin(half), 0, std::cos(half)}};
  EXPECT_DOUBLE_EQ(position_error(a, b), 0.5);
  EXPECT_NEAR(rotation_error(a, b), 0.02, 1e-15);
  const Pose negative{{0, 0, 0}, {0, -std::sin(half), 0, -std::cos(half)}};  // the same rotation
  EXPECT_NEAR(rotation_error(a, negative), 0.02, 1e-15);
  EXPECT_NEAR(rotation_error(b, negative), 0, 1e-15);
}

TEST_F(SimModel, ContactsLimitsAndTorques) {
  double q[8] = {0, 0, 1, 0, 0, 0, 1, 0}, v[7] = {};
  model.set_state(q, v);
  mj_forward(model.m, model.d);
  EXPECT_EQ(model.robot_world_contact(), -1);
  EXPECT_EQ(model.joint_excess(), 0);
  q[2] = 0.34;  // the foot reaches 1 cm into the ground
  q[7] = 0;
  model.set_state(q, v);
  mj_forward(model.m, model.d);
  const int contact = model.robot_world_contact();
  ASSERT_GE(contact, 0);
  EXPECT_NEAR(model.d->contact[contact].dist, -0.01, 1e-12);
  EXPECT_STREQ(model.geom_label(model.d->contact[contact].geom1), "ground");
  q[7] = -1.25;
  model.set_state(q, v);
  EXPECT_DOUBLE_EQ(model.joint_excess(), 0.25);
  const double tau[1] = {-7.5};
  model.set_tau(tau);
  EXPECT_DOUBLE_EQ(model.torque_share(), 0.75);
}

// A judge that is shown a hand at `offset` from its target, without any dynamics.
class JudgeTest : public SimModel {
 protected:
  void SetUp() override {
    SimModel::SetUp();
    series.hand = "foot";
    Jump jump;
    jump.target.pose = {{0.1, 0, 0.7}, {0, 0, 0, 1}};
    series.episodes = {{{0, 0, 1, 0, 0, 0, 1, 0}, {jump, jump}}};
  }
  const JumpRecord* show(double offset, double height = 1) {
    const double q[8] = {offset, 0, height, 0, 0, 0, 1, 0}, v[7] = {};
    const auto event = judge.begin_step(t);
    jump = event.jump;
    model.set_state(q, v);
    mj_forward(model.m, model.d);
    const JumpRecord* record = judge.judge(model, t);
    judge.command(0.5, 1);
    t += 1e-3;
    return record;
  }
  const JumpRecord* show_for(double seconds, double offset) {
    const JumpRecord* record = nullptr;
    for (int i = 0; i < std::lround(seconds * 1e3) && !record; ++i) record = show(offset);
    return record;
  }
  Series series;
  Judge judge{series};
  double t = 0;
  int jump = 0;
};

TEST_F(JudgeTest, ArrivesHoldsAndGoesOnEarly) {
  EXPECT_EQ(show(0.5), nullptr);  // the episode's first state: no task yet
  EXPECT_EQ(jump, 0);
  EXPECT_EQ(show_for(0.5, 0.5), nullptr);
  EXPECT_EQ(jump, 1);
  EXPECT_EQ(show_for(0.2, 0.005), nullptr);  // inside, but not long enough
  EXPECT_EQ(show_for(0.1, 0.02), nullptr);   // out again: the hold starts anew
  const JumpRecord* record = show_for(1, 0.005);
  ASSERT_NE(record, nullptr);
  EXPECT_TRUE(record->success());
  EXPECT_NEAR(record->arrival, 0.8, 1e-9);
  EXPECT_NEAR(record->t_end - record->t_start, 1.1, 1e-9);
  EXPECT_DOUBLE_EQ(record->torque_share, 0.5);
  EXPECT_EQ(record->statuses[1], 1100);
  show(0.5);
  EXPECT_EQ(jump, 2);
}

TEST_F(JudgeTest, LateIsLate) {
  show(0.5);
  const JumpRecord* record = show_for(5, 0.02);
  ASSERT_NE(record, nullptr);
  EXPECT_EQ(record->reason(), "late");
  EXPECT_NEAR(record->t_end - record->t_start, 3.0, 1e-9);
}

TEST_F(JudgeTest, HoldThatBeginsInTimeMayEndAfterTheWindow) {
  show(0.5);
  show_for(2.9, 0.5);
  const JumpRecord* record = show_for(1, 0);
  ASSERT_NE(record, nullptr);
  EXPECT_TRUE(record->success());
  EXPECT_NEAR(record->t_end - record->t_start, 3.2, 1e-9);
}

TEST_F(JudgeTest, ContactFailsTheJumpItHappensInAndNotTheNext) {
  show(0.5);
  show_for(0.1, 0.5);
  show(0.5, 0.34);
  const JumpRecord* record = show_for(1, 0);
  ASSERT_NE(record, nullptr);
  EXPECT_EQ(record->reason(), "contact");
  EXPECT_NEAR(record->contact_time, 0.1, 1e-9);
  EXPECT_EQ(record->contact, "ground - leg");
  record = show_for(1, 0);
  ASSERT_NE(record, nullptr);
  EXPECT_TRUE(record->success());
  EXPECT_TRUE(judge.finished());
}

TEST_F(JudgeTest, ContactLeftOverFromTheJumpBeforeCountsOnceTheArmHasComeFree) {
  show(0.5);
  while (!show(0.5, 0.34)) {
  }
  EXPECT_EQ(judge.records()[0].reason(), "late+contact");
  show(0.5, 0.34);
  show_for(0.1, 0.5);
  EXPECT_LT(judge.records()[1].contact_time, 0);
  show(0.5, 0.34);
  EXPECT_NEAR(judge.records()[1].contact_time, 0.101, 1e-9);
}

}  // namespace
}  // namespace engram::sim
