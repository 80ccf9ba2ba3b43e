#include "tests/support/random_walk.h"

#include "tables/talos_step/tables.h"
#include "tests/support/random_tables.h"

extern "C" {
TabGpr random_talos_step_regression_v1 = talos_step_regression_v1;
TabPca random_talos_step_path_v1 = talos_step_path_v1, random_talos_step_torque_v1 = talos_step_torque_v1;
extern const engram_model random_talos_walk;
}

namespace engram::test {
namespace {

TabGpr& regression = random_talos_step_regression_v1;
TabPca &path = random_talos_step_path_v1, &torque = random_talos_step_torque_v1;

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
  return made_up ? &random_talos_walk : nullptr;
}

}  // namespace engram::test
