// link: engram_tab
// The start-up check of a table: what is refused, and in which words; and the evaluators on tables small enough to do by hand.
#include "controller/tab/tab.h"
#include "controller/tab/tab_gpr.h"
#include "controller/tab/tab_knn.h"
#include "controller/tab/tab_logit.h"
#include "controller/tab/tab_pca.h"
#include "controller/tab/tab_rbf.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <string>

namespace {

constexpr uint64_t kRobot = 0x1111, kTask = 0x2222;

// Three samples on a line, at 0, 1 and 3, remembering 10, 20 and 30; weight of the input 2.
struct Line {
  float lo[1] = {0}, hi[1] = {3}, scale[1] = {2};
  float x[8] = {0, 2, 6, TAB_FAR, TAB_FAR, TAB_FAR, TAB_FAR, TAB_FAR};
  float value[24] = {10, 0, 0, 0, 0, 0, 0, 0, 20, 0, 0, 0, 0, 0, 0, 0, 30};
  const char* text[1] = {"x"};
  TabKnn table{};

  Line() {
    TabHead& h = table.head;
    h.schema = TAB_KNN_SCHEMA;
    h.kind = kTabKnn;
    h.name = "line";
    h.robot_digest = kRobot;
    h.task_digest = kTask;
    h.nin = h.nout = 1;
    h.input_name = h.input_unit = text;
    h.narray = 5;
    const TabArray arrays[] = {{"lo", lo, 1}, {"hi", hi, 1}, {"scale", scale, 1}, {"x", x, 8}, {"value", value, 24}};
    for (int i = 0; i < 5; ++i) h.array[i] = arrays[i];
    table.n = 3;
    table.d = table.m = 1;
    table.scale = scale;
    table.x = x;
    table.value = value;
    h.digest = tab_digest(&h);
  }

  std::string complaint(TabKind kind = kTabKnn, uint64_t robot = kRobot, uint64_t task = kTask) const {
    char message[TAB_TEXT];
    const TabStatus status = tab_check(&table.head, kind, robot, task, message);
    EXPECT_EQ(status == kTabOk, message[0] == 0);
    return message;
  }
};

bool contains(const std::string& text, const char* part) { return text.find(part) != std::string::npos; }

TEST(TabCheck, AcceptsTheTableItWasAskedFor) {
  EXPECT_EQ(Line().complaint(), "");
  EXPECT_EQ(Line().complaint(kTabKnn, 0, 0), "");
}

TEST(TabCheck, NamesWhatDiffersAndTheMend) {
  const struct {
    std::string text;
    const char* part;
  } cases[] = {
      {Line().complaint(kTabGpr), "another kind: k-NN"},
      {Line().complaint(kTabKnn, 0x9), "another robot: its digest is 0x0000000000001111, expected 0x0000000000000009"},
      {Line().complaint(kTabKnn, kRobot, 0x9), "another task: its digest is 0x0000000000002222"},
  };
  for (const auto& c : cases) {
    EXPECT_TRUE(contains(c.text, c.part)) << c.text;
    EXPECT_TRUE(contains(c.text, "'line'") && contains(c.text, "run 'make tables'")) << c.text;
  }
  char text[TAB_TEXT];
  EXPECT_EQ(tab_check(nullptr, kTabGpr, 0, 0, text), kTabBad);
  EXPECT_TRUE(contains(text, "no GPR table"));
}

TEST(TabCheck, RefusesAnotherSchemaAndContradictingSizes) {
  Line line;
  line.table.head.schema = 99;
  EXPECT_TRUE(contains(line.complaint(), "schema 0x0000000000000063"));
  line = Line();
  line.table.n = 9;  // would read past x
  EXPECT_TRUE(contains(line.complaint(), "contradict"));
  line.table.head.nin = TAB_MAX_IN + 1;
  EXPECT_TRUE(contains(line.complaint(), "contradict"));
}

TEST(TabCheck, SeesEverySingleFlippedBit) {
  Line line;
  for (float& number : line.x) {
    for (int bit = 0; bit < 32; ++bit) {
      uint32_t word;
      std::memcpy(&word, &number, 4);
      const uint32_t flipped = word ^ (1u << bit);
      std::memcpy(&number, &flipped, 4);
      EXPECT_TRUE(contains(line.complaint(), "damaged"));
      std::memcpy(&number, &word, 4);
    }
  }
  EXPECT_EQ(line.complaint(), "");
}

TEST(TabCheck, CutsALongNameInsteadOfOverflowing) {
  Line line;
  const std::string name(1000, 'n');
  line.table.head.name = name.c_str();
  line.table.head.kind = 77;
  const std::string text = line.complaint();
  EXPECT_EQ(text.size(), size_t{TAB_TEXT - 1});
  EXPECT_STREQ(tab_kind_text(77), "unknown");
}

TEST(TabKnn, ByHand) {
  Line line;
  int32_t index[3];
  float d2[3];
  const double x = 0.9;
  ASSERT_EQ(tab_knn_query(&line.table, &x, 3, index, d2), kTabOk);
  EXPECT_EQ(index[0], 1);
  EXPECT_EQ(index[1], 0);
  EXPECT_EQ(index[2], 2);
  EXPECT_NEAR(d2[0], 0.04, 1e-6);   // (2 (0.9 - 1))^2, in float
  EXPECT_NEAR(d2[1], 3.24, 1e-6);   // (2 (0.9 - 0))^2
  EXPECT_NEAR(d2[2], 17.64, 1e-5);  // (2 (0.9 - 3))^2
  EXPECT_EQ(tab_knn_value(&line.table, index[0])[0], 20);
}

TEST(TabKnn, AmongEqualsTheEarlierSampleComesFirst) {
  Line line;
  int32_t index[2];
  float d2[2];
  const double middle = 2.0;  // as far from the sample at 1 as from the one at 3
  ASSERT_EQ(tab_knn_query(&line.table, &middle, 2, index, d2), kTabOk);
  EXPECT_EQ(d2[0], d2[1]);
  EXPECT_EQ(index[0], 1);
  EXPECT_EQ(index[1], 2);
  line.x[0] = line.x[1] = line.x[2] = 4;
  ASSERT_EQ(tab_knn_query(&line.table, &middle, 2, index, d2), kTabOk);
  EXPECT_EQ(index[0], 0);
  EXPECT_EQ(index[1], 1);
}

TEST(TabKnn, OutsideItsDomainItSaysSo) {
  Line line;
  int32_t index;
  float d2;
  const double far = 3.5;
  EXPECT_EQ(tab_knn_query(&line.table, &far, 1, &index, &d2), kTabOutside);
  EXPECT_EQ(index, 2);
  EXPECT_STREQ(tab_status_text(kTabOutside), "outside the table's domain");
}

TEST(TabGpr, OneSampleByHand) {
  const float lo[1] = {0}, hi[1] = {2}, inverse[1] = {0.5f}, alpha[8] = {3}, mean[8] = {1}, linv[8] = {0.5f};
  float x[8] = {0.5f, TAB_FAR, TAB_FAR, TAB_FAR, TAB_FAR, TAB_FAR, TAB_FAR, TAB_FAR};  // the sample 1, over a length of 2
  TabGpr gpr{};
  gpr.head.nin = 1;
  gpr.head.array[0] = {"lo", lo, 1};
  gpr.head.array[1] = {"hi", hi, 1};
  gpr.n = gpr.d = gpr.m = 1;
  gpr.variance = 2;
  gpr.noise = 0.25f;
  gpr.inv_length = inverse;
  gpr.x = x;
  gpr.alpha = alpha;
  gpr.mean = mean;
  gpr.linv = linv;
  const double query = 2;
  float out[8], var;
  ASSERT_EQ(tab_gpr_query(&gpr, &query, out, &var), kTabOk);
  const double k = 2 * std::exp(-0.5 * 0.25);  // distance 1 over length 2
  EXPECT_NEAR(out[0], 1 + 3 * k, 1e-6);        // float
  EXPECT_NEAR(var, 2.25 - 0.25 * k * k, 1e-6);
  EXPECT_EQ(tab_gpr_linv_size(1), 8);
  EXPECT_EQ(tab_gpr_linv_size(9), 8 * 8 + 16);
}

TEST(TabLogit, HalfAtScoreZeroAndClampedOutside) {
  const float lo[1] = {-1}, hi[1] = {1}, weight[1] = {2};
  TabLogit logit{};
  logit.head.nin = 1;
  logit.head.array[0] = {"lo", lo, 1};
  logit.head.array[1] = {"hi", hi, 1};
  logit.d = 1;
  logit.bias = -1;
  logit.weight = weight;
  double x = 0.5, p, edge;
  EXPECT_EQ(tab_logit_eval(&logit, &x, &p), kTabOk);
  EXPECT_DOUBLE_EQ(p, 0.5);
  x = 1;
  EXPECT_EQ(tab_logit_eval(&logit, &x, &edge), kTabOk);
  x = 50;
  EXPECT_EQ(tab_logit_eval(&logit, &x, &p), kTabOutside);
  EXPECT_EQ(p, edge);
  x = NAN;
  EXPECT_EQ(tab_logit_eval(&logit, &x, &p), kTabNotFinite);
  EXPECT_EQ(p, 0);
}

}  // namespace
