// link: engram_io
// options: -O1
// Lock step: every state is answered once, the same bytes in give the same bytes out, and trouble changes nothing.
#include "controller/io/io_lockstep.h"

#include <gtest/gtest.h>

#include "tests/support/wire.h"

namespace engram::test {
namespace {

using io::Trouble;

// A controller in lock step with a plant over bytes.
struct Session {
  PandaController controller;
  io::Report report{nullptr};
  io::Notes notes{&report};
  Wire wire;
  io::Lockstep lockstep{controller.handle, wire.sender(), &notes, &report};
  PandaPlant plant;
  int64_t seq = 0;

  template <class M> void state(const M& m) {
    const auto bytes = bytes_of(m);
    lockstep.on_state(bytes.data(), static_cast<uint32_t>(bytes.size()));
  }
  void task(const double* value, int64_t number, int32_t jump) {
    const auto bytes = bytes_of(task_message(value, plant.utime, number, jump));
    lockstep.on_task(bytes.data(), static_cast<uint32_t>(bytes.size()));
  }
  engram_msg_command_t command() const {
    engram_msg_command_t m = {};
    const auto bytes = wire.last(io::kCommandChannel);
    EXPECT_EQ(io::read_message(bytes.data(), static_cast<uint32_t>(bytes.size()), &m), io::Decoded::kGood);
    return m;
  }
  void run(int steps) {
    for (int i = 0; i < steps; ++i) {
      state(state_message(plant, ++seq));
      const engram_msg_command_t c = command();
      ASSERT_EQ(c.seq, seq);
      ASSERT_EQ(c.utime, plant.utime);
      ASSERT_EQ(c.nu, 7);
      plant.step(c.tau);
    }
  }
};

TEST(Lockstep, AnswersEveryStateAndLogsEveryTenth) {
  Session s;
  s.run(100);
  EXPECT_EQ(s.wire.count(io::kCommandChannel), 100);
  EXPECT_EQ(s.wire.count(io::kCycleChannel), 10);
  EXPECT_EQ(s.wire.count(io::kTimingChannel), 10);
  EXPECT_EQ(s.command().robot_digest, static_cast<int64_t>(robots::Panda::digest));
}

TEST(Lockstep, TwoRunsGiveTheSameBytes) {
  Session a, b;
  for (Session* s : {&a, &b}) {
    s->run(25);
    s->task(kTaskNear, 1, 1);
    s->run(100);
    s->task(kTaskRight, 2, 2);
    s->run(100);
  }
  ASSERT_EQ(a.wire.sent.size(), b.wire.sent.size());
  for (size_t i = 0; i < a.wire.sent.size(); ++i) {
    if (a.wire.sent[i].channel == io::kTimingChannel) continue;  // measured
    ASSERT_EQ(a.wire.sent[i].bytes, b.wire.sent[i].bytes) << a.wire.sent[i].channel << ' ' << i;
  }
}

TEST(Lockstep, ADuplicateGetsTheSameAnswerAndNothingElseHappens) {
  Session s;
  s.run(25);
  s.task(kTaskNear, 1, 1);
  s.run(211);
  const auto answer = s.wire.last(io::kCommandChannel);
  const size_t sent = s.wire.sent.size();
  PandaPlant before = s.plant;
  before.utime -= 1000;
  engram_msg_state_t again = state_message(before, s.seq);
  s.state(again);
  EXPECT_EQ(s.wire.sent.size(), sent + 1);
  EXPECT_EQ(s.wire.last(io::kCommandChannel), answer);
}

TEST(Lockstep, TroubleChangesNothing) {
  Session quiet, noisy;
  const auto garbage = [&](int i) {
    engram_msg_state_t m = state_message(noisy.plant, noisy.seq + 1);
    switch (i % 5) {
      case 0:
        m.robot_digest ^= 2;
        break;
      case 1:
        m.nv = 9;
        break;
      case 2:
        m.seq = 0;
        break;
      case 3:
        noisy.state(task_message(kTaskNear, 0, 7, 7));
        return;
      default:
        noisy.lockstep.on_state("short", 5);
        return;
    }
    noisy.state(m);
  };
  quiet.task(kTaskNear, 1, 1);
  noisy.task(kTaskNear, 1, 1);
  for (int i = 0; i < 150; ++i) {
    garbage(i);
    quiet.run(1);
    noisy.run(1);
    ASSERT_EQ(quiet.wire.last(io::kCommandChannel), noisy.wire.last(io::kCommandChannel));
  }
  EXPECT_EQ(noisy.report.count(Trouble::kRobotDigest), 30);
  EXPECT_EQ(noisy.report.count(Trouble::kShape), 30);
  EXPECT_EQ(noisy.report.count(Trouble::kOutOfOrder), 30);
  EXPECT_EQ(noisy.report.count(Trouble::kForeign), 30);
  EXPECT_EQ(noisy.report.count(Trouble::kSize), 30);
}

TEST(Lockstep, ABadStateIsAnsweredSafely) {
  Session s;
  s.run(10);
  engram_msg_state_t m = state_message(s.plant, ++s.seq);
  m.q[3] = std::numeric_limits<double>::quiet_NaN();
  s.state(m);
  EXPECT_EQ(s.command().seq, s.seq);
  EXPECT_EQ(s.command().status, ENGRAM_BAD_STATE);
  EXPECT_EQ(s.report.count(Trouble::kBadState), 1);
}

TEST(Lockstep, ARestartedPlantFindsAFreshController) {
  Session s, fresh;
  s.run(25);
  s.task(kTaskNear, 1, 1);
  s.run(200);
  s.plant = PandaPlant();
  s.seq = 0;
  for (Session* each : {&s, &fresh}) {
    each->run(25);
    each->task(kTaskRight, 1, 1);
    each->run(100);
  }
  EXPECT_EQ(s.report.count(Trouble::kRestart), 1);
  EXPECT_EQ(s.wire.last(io::kCommandChannel), fresh.wire.last(io::kCommandChannel));
}

TEST(Lockstep, ATaskSentJustBeforeTheRobotIsSetBackStays) {
  Session s;
  s.run(25);
  s.task(kTaskNear, 1, 1);
  s.run(200);
  const int64_t now = s.plant.utime;
  s.plant = PandaPlant();  // set back to its start, while its clock goes on
  s.plant.utime = now;
  s.seq = 0;
  s.task(kTaskRight, 2, 2);
  s.run(60);
  const engram_cycle cycle = s.controller.cycle();
  EXPECT_EQ(cycle.jump, 2);
  EXPECT_NEAR(cycle.path[cycle.npath - 1][1], kTaskRight[1], 0.02);  // where the plan ends
}

TEST(Lockstep, AControllerThatStartsInTheMiddleTakesOver) {
  Session s, late;
  s.run(25);
  s.task(kTaskNear, 1, 1);
  s.run(200);
  late.plant = s.plant;
  late.seq = s.seq;
  late.task(kTaskNear, 1, 1);
  late.run(60);
  const engram_cycle cycle = late.controller.cycle();
  EXPECT_EQ(cycle.rung, ENGRAM_RUNG_PLAN);
  EXPECT_NEAR(cycle.path[cycle.npath - 1][1], kTaskNear[1], 0.02);  // where the plan ends
}

TEST(Lockstep, AnUnsentMessageIsReported) {
  Session s;
  s.wire.broken = true;
  s.state(state_message(s.plant, 1));
  EXPECT_GE(s.report.count(Trouble::kPublish), 2);  // cycle and command
}

}  // namespace
}  // namespace engram::test
