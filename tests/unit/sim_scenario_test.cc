// link: engram_sim
// Scenarios: what is read, what is refused and where, and how an episode is judged, by hand.
#include "sim_harness/sim_scenario.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <fstream>

namespace engram::sim {
namespace {

constexpr char kBox[] = R"(<mujoco><worldbody><body name="trunk"><freejoint/><geom type="box" size="0.2 0.1 0.05" mass="3"/>
  <site name="tip" pos="0.2 0 0"/></body></worldbody></mujoco>)";
constexpr char kGood[] =
    "engram_scenario 1\nrobot_digest 0x12\ntask_digest 0x34\n# a comment\n"
    "episode stand 2\nstate 0 0 1 0 0 0 1\ntask 0 0.5 0.25\ntask 1 0.75 0.5\npush 0.5 0.1 trunk 10 0 0\ngust 1 0.5 trunk 0 4 0  0 0 0.2\n"
    "upright 0.5 0.7\ndrift 0.5 0.01\nheight 1 0.02 0.1 0 0\npace 0.5 0.1 0 0 0\n"
    "episode walk 1\nstate 0 0 1 0 0 1 0\ntask 0 1\nupright 0.5 0.7\npace 0 0.1 1 0 0\n";

std::string written(const char* name, const std::string& text) {
  const std::string path = ::testing::TempDir() + std::to_string(getpid()) + name;
  std::ofstream(path) << text;
  return path;
}

class SimScenario : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_EQ(model.load(written("sim_scenario_test.xml", kBox).c_str()), "");
  }
  std::string read(const std::string& text) { return scenario.read(written("scenario.txt", text).c_str(), model); }
  // One step of a box that is where it is told to be; returns what the referee says.
  std::string show(double x, double z, double turn = 0, double tilt = 0) {
    const double q[7] = {x, 0, z, std::sin(tilt / 2), 0, std::sin(turn / 2), std::sqrt(1 - std::pow(std::sin(tilt / 2), 2) - std::pow(std::sin(turn / 2), 2))};
    const double v[6] = {};
    event = referee.begin_step(t);
    model.set_state(q, v);
    mj_forward(model.m, model.d);
    const std::string said = referee.look(model, t);
    referee.command(0.5, 1);
    t += 1e-3;
    return said;
  }
  Model model;
  Scenario scenario;
  Referee referee{scenario};
  Script::Event event;
  double t = 0;
};

TEST_F(SimScenario, IsReadAsWritten) {
  ASSERT_EQ(read(kGood), "");
  EXPECT_EQ(scenario.robot_digest, 0x12u);
  EXPECT_EQ(scenario.task_digest, 0x34u);
  ASSERT_EQ(scenario.trials.size(), 2u);
  const Trial& trial = scenario.trials[0];
  EXPECT_EQ(trial.name, "stand");
  ASSERT_EQ(trial.tasks.size(), 2u);
  EXPECT_EQ(trial.tasks[1].value, (std::vector<double>{0.75, 0.5}));
  ASSERT_EQ(trial.pushes.size(), 2u);
  EXPECT_EQ(trial.pushes[0].share(0.55), 1.0);
  EXPECT_EQ(trial.pushes[0].share(0.65), 0.0);
  EXPECT_NEAR(trial.pushes[1].share(1.25), 1.0, 1e-15);  // a gust is largest in its middle
  EXPECT_NEAR(trial.pushes[1].share(1.125), 0.5, 1e-15);
  EXPECT_EQ(trial.pushes[1].torque[2], 0.2);
  EXPECT_FALSE(scenario.trials[1].drift.asked());
}

TEST_F(SimScenario, FaultsNameTheirLine) {
  const auto fault = [&](const std::string& line) {
    return Scenario().read(written("fault.txt", "engram_scenario 1\nepisode e 2\nstate 0 0 1 0 0 0 1\ntask 0 1\n" + line + "\n").c_str(), model);
  };
  const auto has = [](const std::string& text, const char* part) { return text.find(part) != std::string::npos; };
  EXPECT_EQ(fault(""), "");
  EXPECT_TRUE(has(fault("psuh 0 1"), ":5: unknown key `psuh`")) << fault("psuh 0 1");
  EXPECT_TRUE(has(fault("push 0 0.1 head 1 0 0"), ":5: the scene has no body 'head'"));
  EXPECT_TRUE(has(fault("push 0 0.1 trunk 1 0"), ":5: the form is `push t d body fx fy fz"));
  EXPECT_TRUE(has(fault("push 0 0 trunk 1 0 0"), ":5: a push needs"));
  EXPECT_TRUE(has(fault("upright 0.5"), ":5: `upright` needs 2 numbers"));
  EXPECT_TRUE(has(fault("upright 0.5 nan"), ":5: not a finite number"));
  EXPECT_TRUE(has(fault("drift 2 0.1"), ":5: `drift` needs a time within the episode"));
  EXPECT_TRUE(has(fault("reach 0 0.1 nose 1 0 0"), ":5: the scene has no site 'nose'"));
  EXPECT_TRUE(has(fault("reach 1 0.1 tip 1 0 0\nreach 0.5 0.1 tip 1 0 0"), ":6: `reach` must come in the order of times"));
  EXPECT_TRUE(has(fault("state 0 0 1"), ":5: `state` needs nq = 7 numbers"));
  EXPECT_TRUE(has(fault("task 0 2"), ":5: tasks must come in the order of their times"));
  EXPECT_TRUE(has(fault("episode f 1"), ":5: episode `f` has no `state`"));
  EXPECT_TRUE(has(fault("episode f"), ":5: the form is `episode name seconds`"));
  EXPECT_TRUE(has(Scenario().read("/nowhere", model), "cannot read the scenario"));
  EXPECT_TRUE(has(read("engram_series 1\n"), ":1: a scenario starts with `engram_scenario 1`"));
  EXPECT_TRUE(has(read("engram_scenario 1\nupright 0 1\n"), ":2: `upright` before the first `episode`"));
  EXPECT_TRUE(has(read("engram_scenario 1\n"), "holds no episode"));
}

TEST_F(SimScenario, TasksComeAfterTheFirstStateAndInTime) {
  ASSERT_EQ(read(kGood), "");
  show(0, 1);
  EXPECT_NE(event.reset, nullptr);
  EXPECT_EQ(event.pushes, &scenario.trials[0].pushes);
  EXPECT_EQ(event.task, nullptr);
  show(0, 1);
  ASSERT_NE(event.task, nullptr);
  EXPECT_EQ(event.jump, 1);
  for (int i = 2; i < 1000; ++i) {
    show(0, 1);
    EXPECT_EQ(event.task, nullptr);
  }
  show(0, 1);
  ASSERT_NE(event.task, nullptr);
  EXPECT_EQ(event.jump, 2);
}

TEST_F(SimScenario, AnEpisodeThatKeepsItsDemandsIsOk) {
  ASSERT_EQ(read(kGood), "");
  std::string said;
  for (int i = 0; i <= 2000; ++i) said = show(0, i < 900 ? 1 : 1.1);  // raised by 0.1 m: a drift of it, and the height asked for
  EXPECT_EQ(said, "episode 1/2 drift 2.00 s stand");
  EXPECT_NEAR(referee.records()[0].drift, 0.1, 1e-12);
  EXPECT_NEAR(referee.records()[0].height_rms(), 0.0, 1e-12);
  EXPECT_DOUBLE_EQ(referee.records()[0].torque_share, 0.5);
  // the second one walks 1 m/s, but looks back (a turn by 180 degrees): its own x is the world's -x
  for (int i = 0; i <= 1000; ++i) said = show(-1e-3 * i, 1, M_PI);
  EXPECT_EQ(said, "episode 2/2 ok 1.00 s walk");
  EXPECT_NEAR(referee.records()[1].pace[0], 1.0, 1e-12);
  EXPECT_TRUE(referee.finished());
}

// Each point until the next task: what the box does afterwards is no matter, and one that is missed is told.
TEST_F(SimScenario, EveryPointIsToBeReached) {
  const std::string head = "engram_scenario 1\nepisode reach 2\nstate 0 0 1 0 0 0 1\ntask 0 1\ntask 1 1\nupright 0.5 0.7\n";
  ASSERT_EQ(read(head + "reach 0.9 0.01 tip 0.2 0 1\nreach 1.9 0.01 tip 0.2 0 1.1\n" + head.substr(18)), "");
  std::string said;
  for (int i = 0; i <= 2000; ++i) said = show(0, i < 1000 ? 1 : 1.1);
  EXPECT_EQ(said, "episode 1/2 ok 2.00 s reach");
  EXPECT_EQ(referee.records()[0].reached(scenario.trials[0]), 2);
  scenario.trials[1].reach = scenario.trials[0].reach;
  for (int i = 0; i <= 2000; ++i) said = show(0, i < 999 ? 1 : 1.1);
  EXPECT_EQ(said, "episode 2/2 reach 2.00 s reach");
  EXPECT_EQ(referee.records()[1].reached(scenario.trials[1]), 1);
}

TEST_F(SimScenario, AFallEndsAnEpisode) {
  ASSERT_EQ(read(kGood), "");
  show(0, 1);
  EXPECT_EQ(show(0, 0.49), "episode 1/2 fall 0.00 s stand");
  show(0, 1);
  EXPECT_EQ(show(0, 1, 0, 0.8), "episode 2/2 fall 0.00 s walk");
  EXPECT_NEAR(referee.records()[1].tilt, 0.8, 1e-9);
}

TEST_F(SimScenario, AStateThatIsNotANumberIsAFall) {
  ASSERT_EQ(read(kGood), "");
  show(0, 1);
  model.d->xpos[3 + 2] = NAN;
  EXPECT_NE(referee.look(model, 1e-3).find("fall"), std::string::npos);
}

}  // namespace
}  // namespace engram::sim
