#include "tests/support/random_walk.h"

#include "controller/loop/loop_controller.h"
#include "controller/loop/loop_receding.h"
#include "controller/loop/loop_talos_walk.h"
#include "tables/talos_step/tables.h"
#include "tests/support/random_tables.h"

namespace engram::test {
namespace {

TabGpr regression = talos_step_regression_v1;
TabPca path = talos_step_path_v1, torque = talos_step_torque_v1;
constexpr StepTables kTables = {&regression, &path, &torque};
using Model = LeggedModel<TalosWalkRemembers<kTables>>;
const engram_model kModel = loop_model<Model, RecedingPlanner<Model>>("talos", "walk");

// All but the domain and the scales of the inputs.
bool make_up() {
  static RandomTables random;
  regression.alpha = random.fill(regression.head, 4, 1.0f);
  regression.mean = random.fill(regression.head, 5, 1.0f);
  path.mean = random.fill(path.head, 2, 0.5f);
  path.basis = random.fill(path.head, 3, 0.1f);
  torque.mean = random.fill(torque.head, 2, 50.0f);
  torque.basis = random.fill(torque.head, 3, 1.0f);
  return true;
}

}  // namespace

const engram_model* random_walk(bool valid) {
  static const bool made_up = make_up();
  for (TabHead* head : {&regression.head, &path.head, &torque.head}) RandomTables::sign(*head);
  path.head.digest ^= !valid;
  return made_up ? &kModel : nullptr;
}

}  // namespace engram::test
