// link: engram_io
// No heap in the control period: every allocator of the process is counted over a closed loop with jumps, messages included, in the
// Release build. The counter is first shown a planted `new`, which it must see. And the controller's memory keeps to its budget.
#include <gtest/gtest.h>

#include "controller/io/io_lockstep.h"
#include "tests/support/count_heap.h"
#include "tests/support/figures.h"
#include "tests/support/wire.h"

namespace engram::test {
namespace {

// Bytes of the static memory of one controller. Raise it only with a reason in the commit.
constexpr size_t kControllerBudget = 1160000;  // of it 99 kB the sampler of the train, 230 kB the guesses of the memory

// The last command, and nothing else: a sender without a heap.
struct LastCommand {
  engram_msg_command_t command = {};
  long long messages = 0;
  static bool send(void* self, const char* channel, const void* bytes, uint32_t size) {
    auto& last = *static_cast<LastCommand*>(self);
    ++last.messages;
    if (std::strcmp(channel, io::kCommandChannel) == 0) io::read_message(bytes, size, &last.command);
    return true;
  }
};

TEST(Heap, ThePlantedNewIsSeen) {
  calls = 0;
  counting = true;
  int* volatile planted = new int(1);
  delete planted;
  counting = false;
  EXPECT_EQ(calls, 2);
}

TEST(Heap, TheControlPeriodAllocatesNothing) {
  constexpr int kSteps = 12000, kJump = 1500;
  PandaController controller;
  ASSERT_EQ(controller.error, ENGRAM_NO_ERROR);
  io::Report report{nullptr};
  io::Notes notes{&report};
  LastCommand last;
  io::Lockstep lockstep(controller.handle, {LastCommand::send, &last}, &notes, &report);
  PandaPlant plant;
  uint8_t bytes[4096];
  calls = 0;
  counting = true;
  for (int64_t i = 0; i < kSteps; ++i) {
    if (i % kJump == 20) {
      const auto jump = static_cast<int32_t>(1 + i / kJump);
      const engram_msg_task_t task = task_message(jump % 2 ? kTaskNear : kTaskRight, plant.utime, jump, jump);
      lockstep.on_task(bytes, static_cast<uint32_t>(io::encode(bytes, sizeof bytes, task)));
    }
    engram_msg_state_t state = state_message(plant, i + 1);
    if (i % 1000 == 777) state.q[2] = NAN;  // faults must not allocate either
    lockstep.on_state(bytes, static_cast<uint32_t>(io::encode(bytes, sizeof bytes, state)));
    plant.step(last.command.tau);
  }
  counting = false;
  EXPECT_EQ(calls, 0);
  EXPECT_EQ(last.messages, kSteps + 2 * kSteps / 10);  // commands, cycles, timings: the loop was alive
  const engram_cycle c = controller.cycle();  // 1480 ms after the eighth jump, to the right
  EXPECT_EQ(c.rung, ENGRAM_RUNG_PLAN);
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(c.path[0][i], kTaskRight[i], 0.01);  // m: it arrived
  write_figure("heap", "heap.panda.allocations", calls, "1", kSteps);
}

TEST(Heap, TheControllerKeepsToItsBudget) {
  const size_t bytes = engram_sizeof(&engram_panda_reach);
  EXPECT_LE(bytes, kControllerBudget);
  write_figure("size", "size.panda.controller_bytes", static_cast<long long>(bytes), "B", 1);
}

}  // namespace
}  // namespace engram::test
