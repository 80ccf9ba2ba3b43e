// link: engram_tab
// Stored numbers become the floats they stand for, and random numbers are those of the published generator.
#include "controller/tab/tab_lanes.h"
#include "controller/tab/tab_random.h"

#include <gtest/gtest.h>

#include <cmath>

namespace {

using namespace engram;

// A half by its definition: sign, 5 bits of exponent, 10 bits of fraction.
float half_by_definition(uint16_t bits) {
  const int exponent = bits >> 10 & 31, fraction = bits & 1023;
  return (bits & 0x8000 ? -1.0f : 1.0f) * (exponent || fraction ? std::ldexp(1.0f + float(fraction) / 1024, exponent - 15) : 0.0f);
}

TEST(TabStorage, EveryHalfIsRestoredExactly) {
  for (uint32_t first = 0; first < 0x10000; first += TAB_LANES) {
    uint16_t half[TAB_LANES];
    for (int i = 0; i < TAB_LANES; ++i) half[i] = uint16_t(first + i);
    const TabLanes found = tab_load_half(half);
    for (int i = 0; i < TAB_LANES; ++i) {
      const int exponent = half[i] >> 10 & 31;
      if (exponent == 31 || (exponent == 0 && (half[i] & 1023))) continue;  // infinities, NaN, denormals: never stored
      EXPECT_EQ(found[i], half_by_definition(half[i])) << half[i];
      EXPECT_EQ(std::signbit(found[i]), half[i] >> 15);
    }
  }
}

TEST(TabStorage, EveryByteIsRestoredExactlyThroughItsType) {
  int8_t byte[256];
  for (int i = 0; i < 256; ++i) byte[i] = int8_t(i - 128);
  for (int first = 0; first < 256; first += TAB_LANES) {
    const TabLanes found = tab_with_type(kTabInt8, [&](auto type) { return tab_load_as<type>(byte, first); });
    for (int i = 0; i < TAB_LANES; ++i) EXPECT_EQ(found[i], float(first + i - 128));
  }
}

TEST(TabStorage, WordsOfEachType) {
  EXPECT_EQ(tab_words(kTabFloat32, 24), 24);
  EXPECT_EQ(tab_words(kTabFloat16, 24), 12);
  EXPECT_EQ(tab_words(kTabInt8, 24), 6);
  EXPECT_EQ(tab_words(kTabInt8, 25), 7);
}

// The known answers that come with the generator's paper (Random123, philox 4x32, 10 rounds).
TEST(TabRandom, KnownAnswers) {
  const struct {
    uint64_t seed, stream, index;
    uint32_t word[4];
  } known[] = {
      {0, 0, 0, {0x6627e8d5, 0xe169c58d, 0xbc57ac4c, 0x9b00dbd8}},
      {~0ull, ~0ull, ~0ull, {0x408f276d, 0x41c83b0e, 0xa20bc7c6, 0x6d5451fd}},
      {0x299f31d0a4093822, 0x0370734413198a2e, 0x85a308d3243f6a88, {0xd16cfe09, 0x94fdcceb, 0x5001e420, 0x24126ea1}},
  };
  for (const auto& k : known) {
    uint32_t word[4];
    tab_random_block(k.seed, k.stream, k.index, word);
    for (int i = 0; i < 4; ++i) EXPECT_EQ(word[i], k.word[i]);
  }
}

TEST(TabRandom, UniformDrawsAreUniform) {
  constexpr int n = 40000;
  double mean = 0, square = 0, neighbours = 0, streams = 0;
  for (int i = 0; i < n; ++i) {
    const double a = tab_random_uniform(7, 3, i);
    ASSERT_TRUE(a >= 0 && a < 1);
    mean += a / n;
    square += a * a / n;
    neighbours += (a - 0.5) * (tab_random_uniform(7, 3, i + 1) - 0.5) / n;
    streams += (a - 0.5) * (tab_random_uniform(7, 4, i) - 0.5) / n;
  }
  // four standard deviations: of a uniform draw 0.289, of its square 0.298, of a product of two 1/12
  EXPECT_NEAR(mean, 0.5, 4 * 0.289 / 200);
  EXPECT_NEAR(square, 1.0 / 3, 4 * 0.298 / 200);
  EXPECT_NEAR(neighbours, 0, 4.0 / 12 / 200);
  EXPECT_NEAR(streams, 0, 4.0 / 12 / 200);
  EXPECT_EQ(tab_random_unit(0), 0.0f);
  EXPECT_LT(tab_random_unit(0xffffffff), 1.0f);
}

}  // namespace
