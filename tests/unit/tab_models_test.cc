// link: engram_tab
// Mixtures, networks and distances small enough to do by hand, and the one call for every kind.
#include "controller/tab/tab_eval.h"
#include "controller/tab/tab_gmr.h"
#include "controller/tab/tab_mlp.h"
#include "controller/tab/tab_sdf.h"

#include <gtest/gtest.h>

#include <cmath>

namespace {

constexpr float kLo[3] = {-10, -10, -10}, kHi[3] = {10, 10, 10}, kOne[8] = {1, 1, 1, 1, 1, 1, 1, 1};

TabHead head(TabKind kind, int nin, int nout) {
  TabHead h{};
  h.kind = kind;
  h.nin = nin;
  h.nout = nout;
  h.array[0] = {"lo", kLo, uint64_t(nin)};
  h.array[1] = {"hi", kHi, uint64_t(nin)};
  return h;
}

// Two components over one input, at -1 and 1, of unit variance; y = 5 + 2 (x + 1) and y = -5.
struct TwoLines {
  float log_norm[8] = {0, 0}, freedom[8] = {0, 0}, mean_x[16] = {-1}, linv[16] = {1}, mean_y[16] = {5}, slope[16] = {2}, var[16] = {0.25f};
  TabGmr table{};
  TwoLines() {
    mean_x[8] = linv[8] = 1;
    mean_y[8] = -5;
    var[8] = 4;
    table.head = head(kTabGmr, 1, 1);
    table.k = 2;
    table.d = table.m = 1;
    table.slope_type = kTabFloat32;
    table.log_norm = log_norm;
    table.freedom = freedom;
    table.mean_x = mean_x;
    table.linv = linv;
    table.mean_y = mean_y;
    table.slope = slope;
    table.slope_scale = kOne;
    table.var = var;
  }
};

TEST(TabGmr, ModesByHand) {
  TwoLines lines;
  const double x = -0.5;
  int32_t index[3];
  float weight[3], y[24], var[24];
  ASSERT_EQ(tab_gmr_modes(&lines.table, &x, 3, index, weight, y, var), kTabOk);
  const double h = 1 / (1 + std::exp(-0.5 * (2.25 - 0.25)));  // distances 0.5 and 1.5
  EXPECT_EQ(index[0], 0);
  EXPECT_EQ(index[1], 1);
  EXPECT_EQ(index[2], -1);
  EXPECT_NEAR(weight[0], h, 1e-6);  // float
  EXPECT_NEAR(weight[1], 1 - h, 1e-6);
  EXPECT_EQ(y[0], 6.0f);
  EXPECT_EQ(y[8], -5.0f);
  EXPECT_EQ(var[0], 0.25f);
  EXPECT_EQ(var[8], 4.0f);
  float mean[8], total[8];
  ASSERT_EQ(tab_gmr_moments(&lines.table, &x, mean, total), kTabOk);
  EXPECT_NEAR(mean[0], h * 6 - (1 - h) * 5, 1e-5);
  EXPECT_NEAR(total[0], h * 0.25 + (1 - h) * 4 + h * (1 - h) * 121, 1e-4);
}

TEST(TabGmr, HeavyTailsOfStudent) {
  TwoLines lines;
  lines.freedom[0] = 3;
  const double x = 2;  // q = 9 for the first, 1 for the second
  int32_t index[2];
  float weight[2], y[16], var[16];
  ASSERT_EQ(tab_gmr_modes(&lines.table, &x, 2, index, weight, y, var), kTabOk);
  const double first = std::pow(1 + 9.0 / 3, -2), second = std::exp(-0.5);
  EXPECT_EQ(index[0], 1);
  EXPECT_NEAR(weight[1], first / (first + second), 1e-6);
  EXPECT_NEAR(var[8], 0.25 * (3 + 9.0) / (3 + 1 - 2), 1e-6);
}

// One input, two hidden units relu(x) and relu(-x), two outputs: their sum |x| and 1 - relu(-x).
struct Kink {
  float weight[8 + 16] = {1, -1, 0, 0, 0, 0, 0, 0, /* hidden to out */ 1, 0, 0, 0, 0, 0, 0, 0, 1, -1};
  float bias[16] = {0, 0, 0, 0, 0, 0, 0, 0, 0, 1}, scale[16];
  TabMlp table{};
  Kink() {
    for (float& s : scale) s = 1;
    table.head = head(kTabMlp, 1, 2);
    table.d = 1;
    table.m = 2;
    table.depth = 1;
    table.hidden = 2;
    table.members = 1;
    table.weight_type = kTabFloat32;
    table.center = kLo;  // -10
    table.inv_width = kOne;
    table.weight = weight;
    table.weight_scale = scale;
    table.bias = bias;
  }
};

TEST(TabMlp, ByHand) {
  Kink kink;
  EXPECT_EQ(tab_mlp_weights(&kink.table), 24);
  EXPECT_EQ(tab_mlp_biases(&kink.table), 16);
  float out[8];
  double x = -7;  // 3 from the centre
  ASSERT_EQ(tab_mlp_eval(&kink.table, 0, &x, out), kTabOk);
  EXPECT_EQ(out[0], 3.0f);
  EXPECT_EQ(out[1], 1.0f);
  x = -12;
  EXPECT_EQ(tab_mlp_eval(&kink.table, 0, &x, out), kTabOutside);
  EXPECT_EQ(out[0], 2.0f);
  EXPECT_EQ(out[1], -1.0f);
}

TEST(TabMlp, MixtureDensityHeadByHand) {
  // no hidden influence: logits 0 and log 3, means 1 and 2, log standard deviations 0 and log 2
  float weight[8 + 16] = {}, scale[16], bias[16] = {0, 0, 0, 0, 0, 0, 0, 0, 0, std::log(3.0f), 1, 2, 0, std::log(2.0f)};
  for (float& s : scale) s = 1;
  Kink kink;
  kink.table.head.nout = kink.table.m = 1;
  kink.table.modes = 2;
  kink.table.weight = weight;
  kink.table.weight_scale = scale;
  kink.table.bias = bias;
  const double x = 0;
  int32_t index[3];
  float p[3], y[24], var[24], mean[8], total[8];
  ASSERT_EQ(tab_answers(&kink.table.head, &x, 3, index, p, y, var), kTabOk);
  EXPECT_EQ(index[0], 1);
  EXPECT_EQ(index[1], 0);
  EXPECT_EQ(index[2], -1);
  EXPECT_NEAR(p[0], 0.75, 1e-6);  // float
  EXPECT_EQ(y[0], 2.0f);
  EXPECT_NEAR(var[0], 4, 1e-5);
  EXPECT_NEAR(var[8], 1, 1e-6);
  ASSERT_EQ(tab_mlp_moments(&kink.table, &x, mean, total), kTabOk);
  EXPECT_NEAR(mean[0], 1.75, 1e-6);
  EXPECT_NEAR(total[0], 0.25 * 1 + 0.75 * 4 + 0.25 * 0.75, 1e-5);
}

TEST(TabSdf, BoxByHand) {
  float box[15 * 8] = {}, none[32] = {};
  const float numbers[15] = {1, 0, 0, /* a quarter turn about z */ 0, -1, 0, 1, 0, 0, 0, 0, 1, /* half */ 1, 2, 3};
  for (int i = 0; i < 15; ++i) box[8 * i] = numbers[i];
  TabSdf sdf{};
  sdf.head = head(kTabSdf, 3, 1);
  sdf.nbox = 1;
  sdf.box = box;
  sdf.sphere = none;
  float d, g[3];
  const double right[3] = {4, 0.5, 0};  // the box is 4 m wide along the world's x now: it ends at 3
  ASSERT_EQ(tab_sdf_eval(&sdf, right, &d, g), kTabOk);
  EXPECT_EQ(d, 1.0f);
  EXPECT_EQ(g[0], 1.0f);
  EXPECT_EQ(g[1], 0.0f);
  const double inside[3] = {1, 0.75, 0};
  ASSERT_EQ(tab_sdf_eval(&sdf, inside, &d, g), kTabOk);
  EXPECT_EQ(d, -0.25f);
  EXPECT_EQ(g[1], 1.0f);
  const double corner[3] = {6, 5, 0};
  ASSERT_EQ(tab_sdf_eval(&sdf, corner, &d, g), kTabOk);
  EXPECT_EQ(d, 5.0f);  // 3 beyond in x, 4 in y
  EXPECT_NEAR(g[1], 0.8, 1e-6);
  sdf.nbox = 0;
  ASSERT_EQ(tab_sdf_eval(&sdf, corner, &d, g), kTabOk);
  EXPECT_TRUE(std::isinf(d) && g[0] == 0 && g[1] == 0);
}

TEST(TabEval, UnknownKindsAreRefused) {
  TabHead h = head(kTabRbf, 1, 1);
  const double x = 0;
  float y[8];
  EXPECT_EQ(tab_eval(&h, &x, y, nullptr), kTabBad);
  h.kind = 99;
  EXPECT_EQ(tab_eval(&h, &x, y, nullptr), kTabBad);
  EXPECT_EQ(y[0], 0);
}

}  // namespace
