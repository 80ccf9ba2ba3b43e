// link: engram_talos_pole legged_plant random_talos_pole
// A memory that talks nonsense does no harm: tables of random numbers with a valid digest, in closed loop; and whatever a memory says, the
// plan that is accepted never costs more than the shifted one.
#include <gtest/gtest.h>

#include <cmath>

#include "tables/talos_pole/tables.h"
#include "tests/support/legged_plant.h"
#include "tests/support/random_tables.h"

extern "C" {
TabKnn random_talos_pole_knn_v1 = talos_pole_knn_v1;
TabPca random_talos_pole_path_v1 = talos_pole_path_v1;
extern const engram_model random_talos_pole;
}

namespace engram::test {
namespace {

TabKnn& random_knn = random_talos_pole_knn_v1;
TabPca& random_path = random_talos_pole_path_v1;

// Every array but the domain and the scales.
class MakeUp : public testing::Environment {
 public:
  void SetUp() override {
    random_knn.x = random_.fill(random_knn.head, 3, 1.0f);
    random_knn.value = random_.fill(random_knn.head, 4, 3.0f);
    random_path.mean = random_.fill(random_path.head, 2, 1.5f);
    random_path.basis = random_.fill(random_path.head, 3, 0.5f);
    RandomTables::sign(random_knn.head);
    RandomTables::sign(random_path.head);
  }

 private:
  RandomTables random_;
};
testing::Environment* const kTables = testing::AddGlobalTestEnvironment(new MakeUp);

constexpr double kRight[3] = {0.40, -0.53, 1.04}, kLeft[3] = {0.33, -0.06, 1.16}, kWay[3] = {0.12, -0.27, 1.0};

struct Loop {
  explicit Loop(const engram_model* model, const engram_options* options = nullptr) : plant(model, 0.0), controller(model, options) {}
  LeggedPlant plant;
  LeggedController controller;
  int asked = 0, won = 0, worse = 0, jump = 0;

  void go(const double* target, int ms) {
    ASSERT_EQ(engram_set_task(controller.handle, plant.utime, ++jump, target, 3), ENGRAM_CONVERGED);
    for (int t = 0; t < ms; ++t) {
      const bool ticks = plant.utime % 10000 == 0;
      controller.step(plant);
      const engram_cycle& c = controller.cycle();
      if (ticks && c.nguess == 2) {
        ++asked;
        const bool memory = c.winner == ENGRAM_CANDIDATE_KNN;
        won += memory;
        worse += !(c.merit[memory] <= c.merit[0]);
      }
      ASSERT_GT(plant.base_up(), 0.9) << "fallen at " << t << " ms of jump " << jump;
    }
  }
  double away(const double* p) const {
    const double* const hand = plant.data()->site_xpos + 3 * mj_name2id(plant.model(), mjOBJ_SITE, "right_gripper");
    return std::hypot(hand[0] - p[0], hand[1] - p[1], hand[2] - p[2]);
  }
};

// The motion that the shifted plan alone masters (legged_pole_test.cc).
TEST(PoleAdversary, RandomTablesDoNoHarm) {
  Loop loop(&random_talos_pole);
  ASSERT_EQ(loop.controller.error, ENGRAM_NO_ERROR);
  loop.go(kRight, 2000);
  EXPECT_LT(loop.away(kRight), 0.02);
  loop.go(kWay, 1000);
  loop.go(kLeft, 2000);
  EXPECT_LT(loop.away(kLeft), 0.02);
  EXPECT_EQ(loop.asked, 498);  // of 500 periods: in the first two there is no plan to be a rival of
  EXPECT_EQ(loop.worse, 0);
  RecordProperty("won", loop.won);
}

TEST(PoleAdversary, TheAcceptedPlanNeverCostsMoreThanTheShiftedOne) {
  Loop loop(&engram_talos_pole);
  constexpr double kEdge[3] = {0.55, -0.75, 0.8};  // of the task's domain, where no run has been
  loop.go(kRight, 1000);
  loop.go(kLeft, 1500);
  loop.go(kEdge, 500);
  EXPECT_EQ(loop.asked, 298);  // of 300 periods
  EXPECT_GT(loop.won, 20);
  EXPECT_EQ(loop.worse, 0);
}

}  // namespace
}  // namespace engram::test
