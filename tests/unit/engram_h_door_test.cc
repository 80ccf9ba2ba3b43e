// link: engram_panda_reach
// options: -O1
// The door: sizes, placement, options, texts, several controllers in one program.
#include <gtest/gtest.h>

#include <cfenv>
#include <cmath>
#include <cstring>
#include <set>
#include <string>
#include <vector>

#include "tables/panda_reach/task.h"
#include "tests/support/panda_plant.h"

namespace engram::test {
namespace {

const engram_model* const kModel = &engram_panda_reach;

TEST(Door, DescribesItsModel) {
  const engram_description& about = *engram_describe(kModel);
  EXPECT_STREQ(about.robot, "panda");
  EXPECT_STREQ(about.task, "reach");
  EXPECT_EQ(about.robot_digest, robots::Panda::digest);
  EXPECT_EQ(about.nq, 7);
  EXPECT_EQ(about.nv, 7);
  EXPECT_EQ(about.nu, 7);
  EXPECT_EQ(about.task_digest, tasks::PandaReach::digest);
  EXPECT_EQ(about.ntask, tasks::PandaReach::ntask);
  EXPECT_EQ(about.knots, tasks::PandaReach::nknots);
  EXPECT_NEAR(about.knot_dt, tasks::PandaReach::dt, 1e-6);  // knots are whole microseconds
  EXPECT_EQ(about.tick_us, 10000);
  EXPECT_STREQ(engram_version(), ENGRAM_VERSION);
}

TEST(Door, EveryValueHasItsOwnText) {
  std::set<std::string> texts;
  for (int i = 0; i <= ENGRAM_ERROR_TABLES; ++i) texts.insert(engram_error_text(static_cast<engram_error>(i)));
  for (int i = 0; i < ENGRAM_STATUS_COUNT; ++i) texts.insert(engram_status_text(static_cast<engram_status>(i)));
  EXPECT_EQ(texts.size(), size_t{ENGRAM_ERROR_TABLES + 1 + ENGRAM_STATUS_COUNT});
  for (const char* t :
       {engram_error_text(static_cast<engram_error>(99)), engram_status_text(static_cast<engram_status>(99)),
        engram_rung_text(static_cast<engram_rung>(99)), engram_candidate_text(static_cast<engram_candidate>(99))}) {
    EXPECT_NE(std::string(t).find("unknown"), std::string::npos);
  }
  EXPECT_STREQ(engram_rung_text(ENGRAM_RUNG_OFF), "off");
  EXPECT_STREQ(engram_candidate_text(ENGRAM_CANDIDATE_COLD), "cold");
}

TEST(Door, AcceptsAnyAlignmentAndStaysInItsBlock) {
  const size_t bytes = engram_sizeof(kModel);
  std::vector<unsigned char> block(bytes + 256, 0xA5);
  for (size_t shift : {0, 1, 7, 33, 63}) {
    std::fill(block.begin(), block.end(), 0xA5);
    engram_controller* handle = nullptr;
    unsigned char* const at = block.data() + 96 + shift;
    ASSERT_EQ(engram_init(kModel, at, bytes, nullptr, &handle), ENGRAM_NO_ERROR);
    EXPECT_EQ(reinterpret_cast<uintptr_t>(handle) % ENGRAM_ALIGN, 0u);
    EXPECT_EQ(engram_model_of(handle), kModel);
    PandaPlant plant;
    double tau[7];
    engram_set_task(handle, 0, 1, kTaskNear, 7);
    for (int64_t t = 0; t < 30000; t += 10000) {
      engram_feedback(handle, t, plant.q, plant.v);
      engram_command(handle, t, plant.q, plant.v, tau);
      engram_prepare(handle, t + 10000);
    }
    for (size_t i = 0; i < block.size(); ++i) {
      const bool inside = i >= 96 + shift && i < 96 + shift + bytes;
      if (!inside) {
        ASSERT_EQ(block[i], 0xA5) << "byte " << i << " was overwritten";
      }
    }
  }
}

TEST(Door, RefusesWrongCallsWithAReason) {
  const size_t bytes = engram_sizeof(kModel);
  std::vector<unsigned char> block(bytes);
  engram_controller* handle = reinterpret_cast<engram_controller*>(block.data());
  EXPECT_EQ(engram_init(kModel, block.data(), bytes, nullptr, nullptr), ENGRAM_ERROR_NULL);
  EXPECT_EQ(engram_init(kModel, nullptr, bytes, nullptr, &handle), ENGRAM_ERROR_NULL);
  EXPECT_EQ(handle, nullptr);
  EXPECT_EQ(engram_init(nullptr, block.data(), bytes, nullptr, &handle), ENGRAM_ERROR_NULL);
  EXPECT_EQ(engram_init(kModel, block.data(), bytes - 1, nullptr, &handle), ENGRAM_ERROR_MEMORY);

  const auto with = [&](auto change) {
    engram_options o;
    engram_default_options(kModel, &o);
    change(o);
    return engram_init(kModel, block.data(), bytes, &o, &handle);
  };
  EXPECT_EQ(with([](auto&) {}), ENGRAM_NO_ERROR);
  EXPECT_EQ(with([](auto& o) { o.memory = static_cast<engram_mode>(4); }), ENGRAM_ERROR_MODE);
  EXPECT_EQ(with([](auto& o) { o.iterations = 0; }), ENGRAM_ERROR_ITERATIONS);
  EXPECT_EQ(with([](auto& o) { o.iterations_jump = 51; }), ENGRAM_ERROR_ITERATIONS);
  EXPECT_EQ(with([](auto& o) { o.line_search = 11; }), ENGRAM_ERROR_ITERATIONS);
  EXPECT_EQ(with([](auto& o) { o.budget_us = 100; }), ENGRAM_ERROR_BUDGET);  // no clock
  EXPECT_EQ(with([](auto& o) { o.budget_us = NAN; }), ENGRAM_ERROR_BUDGET);
  EXPECT_EQ(with([](auto& o) { o.torque_rate = 0; }), ENGRAM_ERROR_LIMITS);
  EXPECT_EQ(with([](auto& o) { o.clearance_min = NAN; }), ENGRAM_ERROR_LIMITS);
  EXPECT_EQ(with([](auto& o) { o.switch_gain = 2; }), ENGRAM_ERROR_LIMITS);
  EXPECT_EQ(with([](auto& o) { o.hold_rate = 0; }), ENGRAM_ERROR_LIMITS);
  EXPECT_EQ(with([](auto& o) { o.delay_us = ENGRAM_DELAY_MAX_US + 1; }), ENGRAM_ERROR_DELAY);
  EXPECT_EQ(with([](auto& o) { o.state_gap_us = 1; }), ENGRAM_ERROR_WATCHDOG);
  EXPECT_EQ(with([](auto& o) { o.plan_age_us = 1; }), ENGRAM_ERROR_WATCHDOG);
  EXPECT_EQ(with([](auto& o) { o.off_after_us = o.state_gap_us - 1; }), ENGRAM_ERROR_WATCHDOG);
}

TEST(Door, ControllersAreIndependentAndRepeatToTheBit) {
  PandaController a, b;
  PandaPlant plant_a, plant_b;
  for (int i = 0; i < 400; ++i) {
    if (i == 30) {
      engram_set_task(a.handle, plant_a.utime, 1, kTaskNear, 7);
      engram_set_task(b.handle, plant_b.utime, 1, kTaskNear, 7);
    }
    a.step(plant_a);
    b.step(plant_b);
    ASSERT_EQ(std::memcmp(a.tau, b.tau, sizeof a.tau), 0) << "at step " << i;
  }
  // reset: as new
  engram_reset(a.handle);
  PandaPlant again;
  PandaController fresh;
  for (int i = 0; i < 200; ++i) {
    if (i == 30) engram_set_task(a.handle, again.utime, 1, kTaskRight, 7);
    if (i == 30) engram_set_task(fresh.handle, again.utime, 1, kTaskRight, 7);
    PandaPlant copy = again;
    fresh.step(copy);
    a.step(again);
    ASSERT_EQ(std::memcmp(a.tau, fresh.tau, sizeof a.tau), 0) << "at step " << i;
  }
}

// Moves there and back: the goal at which the hand is costs least. Asking changes nothing else.

TEST(Door, LeavesTheFloatingPointModeAsItWas) {
  volatile double tiny = 1e-310;  // subnormal
  PandaController c;
  PandaPlant plant;
  for (int i = 0; i < 30; ++i) c.step(plant);
  EXPECT_NE(tiny * 0.5, 0.0);
}

TEST(Door, AJumpIsRecorded) {
  engram_options o;
  engram_default_options(kModel, &o);
  o.memory = ENGRAM_MODE_COLD;  // a guess that leaves the solver something to do
  PandaController c(&o);
  PandaPlant plant;
  engram_jump jump;
  engram_jump_info(c.handle, &jump);
  EXPECT_EQ(jump.jump, 0);
  for (int i = 0; i < 60; ++i) {
    if (i == 20) engram_set_task(c.handle, plant.utime, 1, kTaskNear, 7);
    c.step(plant);
  }
  engram_jump_info(c.handle, &jump);
  EXPECT_EQ(jump.jump, 1);
  EXPECT_EQ(jump.utime % engram_describe(kModel)->tick_us, 0);
  EXPECT_GE(jump.niterations, 3);
  EXPECT_LT(jump.merit[jump.niterations], 0.1 * jump.merit[0]);  // an easy target: the iterations get nearly there
  for (int i = 0; i < 7; ++i) {
    EXPECT_NEAR(jump.x0[i], robots::Panda::q_home[i], 1e-6);
    EXPECT_EQ(jump.task[i], kTaskNear[i]);
  }
}

TEST(Door, TheBudgetEndsTheIterations) {
  static double now;
  now = 0;
  engram_options o;
  engram_default_options(kModel, &o);
  o.clock = [] { return now += 100.0; };  // us per look at the clock
  o.budget_us = 1000;
  PandaController c(&o);
  ASSERT_EQ(c.error, ENGRAM_NO_ERROR);
  PandaPlant plant;
  for (int i = 0; i < 31; ++i) {
    if (i == 10) engram_set_task(c.handle, plant.utime, 1, kTaskNear, 7);
    c.step(plant);
  }
  EXPECT_LT(c.cycle().iterations, o.iterations_jump);
  EXPECT_GT(c.cycle().total_us, 0.0);
  EXPECT_GT(c.cycle().linearize_us, 0.0);
}

}  // namespace
}  // namespace engram::test
