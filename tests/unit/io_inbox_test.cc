// link: engram_io
// The gate-keeper: each kind of bad message is counted under its name and changes nothing.
#include "controller/io/io_inbox.h"

#include <gtest/gtest.h>

#include "tests/support/wire.h"

namespace engram::test {
namespace {

using io::Trouble;
using io::Verdict;

struct InboxTest : testing::Test {
  io::Report report{nullptr};
  io::Inbox inbox{*engram_describe(&engram_panda_reach), &report};
  PandaPlant plant;
  engram_msg_state_t state = {};
  engram_msg_task_t task = {};

  template <class M> Verdict hear_state(const M& m) {
    const auto bytes = bytes_of(m);
    return inbox.state(bytes.data(), static_cast<uint32_t>(bytes.size()), &state);
  }
  template <class M> Verdict hear_task(const M& m) {
    const auto bytes = bytes_of(m);
    return inbox.task(bytes.data(), static_cast<uint32_t>(bytes.size()), &task);
  }
  engram_msg_state_t at(int64_t seq) {
    plant.utime = 1000 * seq;
    return state_message(plant, seq);
  }
  // Exactly one more of this kind of trouble, and none of any other.
  void expect_only(Trouble kind, int64_t n) {
    for (int i = 0; i < static_cast<int>(Trouble::kCount); ++i) {
      EXPECT_EQ(report.count(static_cast<Trouble>(i)), static_cast<Trouble>(i) == kind ? n : 0) << "kind " << i;
    }
  }
};

TEST_F(InboxTest, TakesStatesInOrder) {
  for (int64_t seq : {5, 6, 9}) {  // a controller may start late, and states may be lost
    EXPECT_EQ(hear_state(at(seq)), Verdict::kNew);
    EXPECT_EQ(state.seq, seq);
  }
  expect_only(Trouble::kCount, 0);
}

TEST_F(InboxTest, KnowsDuplicatesAndOldStates) {
  hear_state(at(5));
  EXPECT_EQ(hear_state(at(5)), Verdict::kDuplicate);
  expect_only(Trouble::kDuplicate, 1);
  hear_state(at(6));
  EXPECT_EQ(hear_state(at(5)), Verdict::kIgnored);
  EXPECT_EQ(state.seq, 6);
  EXPECT_EQ(report.count(Trouble::kOutOfOrder), 1);
  engram_msg_state_t same_time = at(7);
  same_time.utime = 6000;
  EXPECT_EQ(hear_state(same_time), Verdict::kIgnored);
  EXPECT_EQ(report.count(Trouble::kOutOfOrder), 2);
}

TEST_F(InboxTest, KnowsARestartedPlant) {
  hear_state(at(500));
  EXPECT_EQ(hear_state(at(1)), Verdict::kRestart);
  EXPECT_EQ(state.seq, 1);
  expect_only(Trouble::kRestart, 1);
  EXPECT_EQ(hear_state(at(2)), Verdict::kNew);
}

TEST_F(InboxTest, RefusesTruncatedAndLongMessages) {
  auto bytes = bytes_of(at(1));
  const auto whole = static_cast<uint32_t>(bytes.size());
  bytes.resize(whole + 8);
  for (uint32_t size = 0; size <= whole + 8; ++size) {
    if (size != whole) {
      EXPECT_EQ(inbox.state(bytes.data(), size, &state), Verdict::kIgnored);
    }
  }
  expect_only(Trouble::kSize, whole + 8);
  EXPECT_EQ(state.seq, 0);
}

TEST_F(InboxTest, RefusesForeignFingerprints) {
  EXPECT_EQ(hear_state(task_message(kTaskNear, 0, 1, 1)), Verdict::kIgnored);
  EXPECT_EQ(hear_task(at(1)), Verdict::kIgnored);
  expect_only(Trouble::kForeign, 2);
}

TEST_F(InboxTest, RefusesOtherRobotsAndTasks) {
  engram_msg_state_t other = at(1);
  other.robot_digest ^= 1;
  EXPECT_EQ(hear_state(other), Verdict::kIgnored);
  expect_only(Trouble::kRobotDigest, 1);
  engram_msg_task_t other_task = task_message(kTaskNear, 0, 1, 1);
  other_task.task_digest ^= 1;
  EXPECT_EQ(hear_task(other_task), Verdict::kIgnored);
  EXPECT_EQ(report.count(Trouble::kTaskDigest), 1);
}

TEST_F(InboxTest, RefusesWrongShapes) {
  for (int32_t n : {-1, 0, 6, 8, 65, 1 << 30}) {
    engram_msg_state_t m = at(1);
    m.nq = n;
    EXPECT_EQ(hear_state(m), Verdict::kIgnored);
    m = at(1);
    m.nv = n;
    EXPECT_EQ(hear_state(m), Verdict::kIgnored);
    engram_msg_task_t t = task_message(kTaskNear, 0, 1, 1);
    t.n = n;
    EXPECT_EQ(hear_task(t), Verdict::kIgnored);
  }
  expect_only(Trouble::kShape, 18);
}

TEST_F(InboxTest, TasksMayBeRepeatedButNotReordered) {
  EXPECT_EQ(hear_task(task_message(kTaskNear, 0, 3, 1)), Verdict::kNew);
  EXPECT_EQ(hear_task(task_message(kTaskNear, 0, 3, 1)), Verdict::kDuplicate);
  expect_only(Trouble::kCount, 0);
  EXPECT_EQ(hear_task(task_message(kTaskRight, 0, 2, 1)), Verdict::kIgnored);
  expect_only(Trouble::kOutOfOrder, 1);
  EXPECT_EQ(task.value[0], kTaskNear[0]);
}

}  // namespace
}  // namespace engram::test
