// The single-slot exchange: newest value, never torn, never twice.
#include "controller/loop/loop_exchange.h"

#include <gtest/gtest.h>

#include <thread>

namespace engram::test {
namespace {

TEST(LoopExchange, ReaderGetsTheNewestOnce) {
  Exchange<int> exchange;
  EXPECT_FALSE(exchange.refresh());
  for (int i = 1; i <= 3; ++i) {
    exchange.slot() = i;
    exchange.publish();
  }
  EXPECT_TRUE(exchange.refresh());
  EXPECT_EQ(exchange.value(), 3);
  EXPECT_FALSE(exchange.refresh());
  EXPECT_EQ(exchange.value(), 3);
}

TEST(LoopExchange, ReaderKeepsItsValueWhileTheWriterGoesOn) {
  Exchange<int> exchange;
  exchange.slot() = 1;
  exchange.publish();
  ASSERT_TRUE(exchange.refresh());
  for (int i = 2; i < 10; ++i) {
    exchange.slot() = i;
    exchange.publish();
    EXPECT_EQ(exchange.value(), 1);
  }
  EXPECT_TRUE(exchange.refresh());
  EXPECT_EQ(exchange.value(), 9);
}

TEST(LoopExchange, TwoThreadsNeverTearAValue) {
  struct Block {
    int64_t values[64];
  };
  constexpr int64_t kCount = 200000;
  static Exchange<Block> exchange;
  std::thread writer([] {
    for (int64_t i = 1; i <= kCount; ++i) {
      for (int64_t& v : exchange.slot().values) v = i;
      exchange.publish();
    }
  });
  int64_t last = 0;
  while (last < kCount) {
    if (!exchange.refresh()) continue;
    const Block& block = exchange.value();
    for (int64_t v : block.values) ASSERT_EQ(v, block.values[0]);
    ASSERT_GT(block.values[0], last);
    last = block.values[0];
  }
  writer.join();
}

}  // namespace
}  // namespace engram::test
