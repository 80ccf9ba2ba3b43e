// link: engram_tab
// The tensor train on a table small enough to do by hand, its start-up check, and inputs nobody meant to send.
#include "controller/tab/tab_tt.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

namespace {

// Two variables over [0, 2] and [0, 1], three and two points, rank 2:
//   P = [1 2 3; 0 1 0]' [1 1; 0 4]  =  1 1 | 2 6 | 3 3
struct Small {
  float lo[2] = {0, 0}, hi[2] = {2, 1}, shape[5] = {3, 2, 1, 2, 1}, scale[2] = {1, 1};
  alignas(64) float core[3 * 8 + 2 * 2] = {1, 0, 0, 0, 0, 0, 0, 0, 2, 1, 0, 0, 0, 0, 0, 0, 3, 0, 0, 0, 0, 0, 0, 0, 1, 0, 1, 4};
  const char* text[2] = {"x", "y"};
  TabTt table{};

  Small() {
    TabHead& h = table.head;
    h.schema = TAB_TT_SCHEMA;
    h.kind = kTabTt;
    h.name = "small";
    h.nin = 2;
    h.nout = 1;
    h.input_name = h.input_unit = text;
    h.narray = 5;
    const TabArray arrays[] = {{"lo", lo, 2}, {"hi", hi, 2}, {"shape", shape, 5}, {"scale", scale, 2}, {"core", core, 28}};
    for (int i = 0; i < 5; ++i) h.array[i] = arrays[i];
    table.d = 2;
    table.type = kTabFloat32;
    table.shape = shape;
    table.scale = scale;
    table.core = core;
    h.digest = tab_digest(&h);
  }

  std::string complaint() {
    table.head.digest = tab_digest(&table.head);
    char message[TAB_TEXT];
    (void)tab_check(&table.head, kTabTt, 0, 0, message);
    return message;
  }
};

struct Sampler {
  std::vector<char> memory;
  TabTtSampler sampler;
  Sampler(const TabTt& table, int capacity) : memory(tab_tt_sampler_bytes(&table, capacity) + 64) {
    char* aligned = memory.data() + (64 - reinterpret_cast<uintptr_t>(memory.data()) % 64) % 64;
    EXPECT_EQ(tab_tt_init(&sampler, &table, capacity, aligned, tab_tt_sampler_bytes(&table, capacity)), kTabOk);
  }
};

TEST(TabTt, ValueAndGradientByHand) {
  Small s;
  const double x[2] = {0.5, 0.5};
  double value, gradient[2];
  EXPECT_EQ(tab_tt_value(&s.table, x, &value, gradient), kTabOk);
  EXPECT_EQ(value, 2.5);        // mean of 1 1 2 6
  EXPECT_EQ(gradient[0], 3.0);  // (2 + 6) / 2 - (1 + 1) / 2
  EXPECT_EQ(gradient[1], 2.0);  // (1 + 6) / 2 - (1 + 2) / 2
  const double outside[2] = {-1, 1};
  EXPECT_EQ(tab_tt_value(&s.table, outside, &value, gradient), kTabOutside);
  EXPECT_EQ(value, 1.0);
  EXPECT_EQ(gradient[0], 0.0);
}

TEST(TabTt, ConditionalProbabilitiesByHand) {
  Small s;
  Sampler t(s.table, 64);
  const double at[2] = {0.0, 1.0};
  const bool fix_y[2] = {false, true};
  EXPECT_EQ(tab_tt_condition(&t.sampler, at, fix_y), kTabOk);
  double x[128], log_prob[64];
  EXPECT_EQ(tab_tt_sample(&t.sampler, 0.0, 64, 1, x, log_prob), kTabOk);
  const double expected[3] = {0.1, 0.6, 0.3};  // 1 6 3
  for (int i = 0; i < 64; ++i) {
    EXPECT_EQ(x[2 * i + 1], 1.0);
    EXPECT_NEAR(std::exp(log_prob[i]), expected[int(x[2 * i])], 1e-6);  // floats
  }
  const bool none[2] = {false, false};
  EXPECT_EQ(tab_tt_condition(&t.sampler, at, none), kTabOk);
  EXPECT_EQ(tab_tt_sample(&t.sampler, 1.0, 1, 1, x, nullptr), kTabOk);
  EXPECT_EQ(x[0], 1.0);  // 8 of 16, then 6 of 8
  EXPECT_EQ(x[1], 1.0);
}

// p = 2, 2e-5, 1 of the three points of x: to the power of 10 and of 9.5, what is below 2^-126 has no probability at all.
TEST(TabTt, PowersByHandAndWhatVanishesIsNeverDrawn) {
  Small s;
  s.core[8] = 1e-5f;
  s.core[9] = 0;
  s.core[16] = 0.5f;
  constexpr int kCount = 4096;
  Sampler t(s.table, kCount);
  std::vector<double> x(2 * kCount), log_prob(kCount);
  for (const double beta : {10.0, 9.5}) {
    ASSERT_EQ(tab_tt_sample(&t.sampler, 1 - 1 / beta, kCount, 1, x.data(), log_prob.data()), kTabOk);
    const double half = std::pow(0.5, beta), y = std::log(0.5);  // given x, both points of y are as likely
    int seldom = 0;
    for (int i = 0; i < kCount; ++i) {
      ASSERT_NE(x[2 * i], 1.0);
      seldom += x[2 * i] == 2.0;
      EXPECT_NEAR(log_prob[i], y + std::log((x[2 * i] == 2.0 ? half : 1) / (1 + half)), 4e-5);  // (3 + power) 1e-6 of each power
    }
    EXPECT_NEAR(seldom, kCount * half, 4 * std::sqrt(kCount * half) + 1);
  }
}

TEST(TabTt, CheckRefusesWhatContradictsItself) {
  EXPECT_EQ(Small().complaint(), "");
  for (int i = 0; i < 5; ++i) {
    for (float wrong : {0.0f, -1.0f, 2.5f, 1e9f, NAN, 7.0f}) {
      Small s;
      s.shape[i] = wrong;
      EXPECT_NE(s.complaint(), "") << "shape[" << i << "] = " << wrong;
    }
  }
  Small type, count;
  type.table.type = kTabFloat16;
  EXPECT_NE(type.complaint(), "");
  count.table.head.array[4].count = 27;
  EXPECT_NE(count.complaint(), "");
}

TEST(TabTt, SamplerRefusesTooLittleMemoryAndTooManySamples) {
  Small s;
  TabTtSampler sampler;
  char memory[64];
  EXPECT_EQ(tab_tt_init(&sampler, &s.table, 4, memory, sizeof memory), kTabBad);
  EXPECT_EQ(tab_tt_init(&sampler, &s.table, 0, memory, sizeof memory), kTabBad);
  Sampler t(s.table, 4);
  double x[10];
  EXPECT_EQ(tab_tt_sample(&t.sampler, 0.0, 5, 1, x, nullptr), kTabBad);
  EXPECT_EQ(tab_tt_sample(&t.sampler, 0.0, 0, 1, x, nullptr), kTabBad);
  EXPECT_EQ(tab_tt_sample(&t.sampler, NAN, 1, 1, x, nullptr), kTabBad);
}

TEST(TabTt, AnyBytesInTheCoresAndAnyQueryEndInsideTheGrid) {
  Small s;
  Sampler t(s.table, 16);
  const float odd[] = {NAN, INFINITY, -INFINITY, 3e38f, -3e38f, 1e-45f, 0.0f, 1.0f};
  const double queries[] = {NAN, INFINITY, -1e300, 1e300, 5e-324, 0.7};
  uint32_t state = 1;
  for (int round = 0; round < 2000; ++round) {
    for (float& number : s.core) {
      state = state * 1664525u + 1013904223u;
      number = odd[state >> 29];
    }
    Sampler fresh(s.table, 16);
    const double at[2] = {queries[(state >> 8) % 6], queries[(state >> 12) % 6]};
    const bool fixed[2] = {(state >> 16 & 1) != 0, (state >> 17 & 1) != 0};
    double value, gradient[2], x[32], log_prob[16];
    (void)tab_tt_value(&s.table, at, &value, gradient);
    const TabStatus status = tab_tt_condition(&fresh.sampler, at, fixed);
    ASSERT_EQ(tab_tt_sample(&fresh.sampler, 0.5 * (state >> 20 & 3), 16, round, x, log_prob), kTabOk);
    for (int i = 0; i < 32; ++i) {
      if (status != kTabNotFinite && fixed[i % 2]) continue;
      ASSERT_TRUE(x[i] >= 0 && x[i] <= 2) << x[i];
    }
  }
}

TEST(TabTt, LowestCostsFirst) {
  const double cost[6] = {3, NAN, 1, 2, 1, NAN};
  int32_t index[7];
  tab_lowest(cost, 6, 7, index);
  const int32_t expected[7] = {2, 4, 3, 0, 1, 5, -1};
  for (int i = 0; i < 7; ++i) EXPECT_EQ(index[i], expected[i]);
  tab_lowest(cost, 6, 2, index);
  EXPECT_EQ(index[0], 2);
  EXPECT_EQ(index[1], 4);
}

}  // namespace
