// link: engram_io
// options: -O1
// Garbage at the door of the program: random bytes, broken messages, extreme numbers. Nothing crashes, every torque that leaves is
// finite and within its limit. Run under ASan and UBSan.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "controller/io/io_lockstep.h"
#include "tests/support/wire.h"

namespace engram::test {
namespace {

struct Fuzz : testing::TestWithParam<uint64_t> {
  std::mt19937_64 random{GetParam()};
  PandaController controller;
  io::Report report{nullptr};
  io::Notes notes{&report};
  Wire wire;
  io::Lockstep lockstep{controller.handle, wire.sender(), &notes, &report};
  PandaPlant plant;
  int64_t seq = 0;

  int below(int n) { return std::uniform_int_distribution<int>(0, n - 1)(random); }
  double number() {
    static const double kOdd[] = {std::numeric_limits<double>::quiet_NaN(),
                                  std::numeric_limits<double>::infinity(),
                                  -std::numeric_limits<double>::infinity(),
                                  std::numeric_limits<double>::denorm_min(),
                                  -1e-310,
                                  std::numeric_limits<double>::max(),
                                  -std::numeric_limits<double>::max(),
                                  1e300,
                                  999.9,
                                  -0.0,
                                  0.0};
    constexpr int kCount = sizeof kOdd / sizeof *kOdd;
    const int i = below(kCount + 2);
    if (i < kCount) return kOdd[i];
    uint64_t bits = random();
    double value;
    std::memcpy(&value, &bits, sizeof value);
    return i == kCount ? value : std::normal_distribution<double>(0, 2)(random);
  }
  template <class M> std::vector<uint8_t> broken(const M& m) {
    std::vector<uint8_t> bytes = bytes_of(m);
    switch (below(4)) {
      case 0:
        bytes.resize(static_cast<size_t>(below(static_cast<int>(bytes.size()) + 64)));
        break;
      case 1:
        bytes[static_cast<size_t>(below(8))] ^= static_cast<uint8_t>(1 + below(255));
        break;  // fingerprint
      case 2:
        for (int i = below(20); i >= 0; --i) bytes[8 + random() % (bytes.size() - 8)] ^= static_cast<uint8_t>(random());
        break;
      default:
        for (uint8_t& b : bytes) b = static_cast<uint8_t>(random());
    }
    return bytes;
  }
  void hear_state(const std::vector<uint8_t>& b) { lockstep.on_state(b.data(), static_cast<uint32_t>(b.size())); }
  void hear_task(const std::vector<uint8_t>& b) { lockstep.on_task(b.data(), static_cast<uint32_t>(b.size())); }
  void check_sent() {
    for (const Sent& s : wire.sent) {
      if (s.channel != io::kCommandChannel) continue;
      engram_msg_command_t c = {};
      ASSERT_EQ(io::read_message(s.bytes.data(), static_cast<uint32_t>(s.bytes.size()), &c), io::Decoded::kGood);
      for (int i = 0; i < c.nu; ++i) ASSERT_LE(std::fabs(c.tau[i]), PandaPlant::R::u_max[i]);  // false for NaN
    }
    wire.sent.clear();
  }
};

TEST_P(Fuzz, MessagesOfAnyBytes) {
  for (int i = 0; i < 300; ++i) {
    engram_msg_state_t state = state_message(plant, ++seq);
    hear_state(broken(state));
    hear_task(broken(task_message(kTaskNear, plant.utime, 1 + i, i / 50)));
    if (below(3)) hear_state(bytes_of(state));
    plant.utime += 1000;
    check_sent();
  }
}

TEST_P(Fuzz, NumbersOfAnyKind) {
  for (int i = 0; i < 200; ++i) {
    engram_msg_state_t state = state_message(plant, ++seq);
    if (below(2)) {
      for (int n = below(4); n >= 0; --n) {
        const double value = number();
        double* const field = below(2) ? state.q : state.v;
        field[below(7)] = value;
      }
    }
    if (below(10) == 0) plant.utime += below(3) ? 1000000 : int64_t{1} << 40;
    state.utime = plant.utime;
    if (below(8) == 0) {
      engram_msg_task_t task = task_message(below(2) ? kTaskNear : kTaskRight, plant.utime, i + 1, i / 16);
      if (below(2)) task.value[below(7)] = number();
      if (below(8) == 0) task.utime = static_cast<int64_t>(random());
      hear_task(bytes_of(task));
    }
    hear_state(bytes_of(state));
    plant.utime += 1000;
    check_sent();
  }
  // and it still works
  engram_reset(controller.handle);
  plant = PandaPlant();
  engram_set_task(controller.handle, 0, 1000, kTaskNear, 7);
  for (int i = 0; i < 40; ++i) controller.step(plant);
  EXPECT_EQ(controller.cycle().rung, ENGRAM_RUNG_PLAN);
}

INSTANTIATE_TEST_SUITE_P(Seeds, Fuzz, testing::Range<uint64_t>(1, 5));

}  // namespace
}  // namespace engram::test
