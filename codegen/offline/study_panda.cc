// The Panda among table, box and shelf: costs of thesis tables 7.1 to 7.3.
#include "codegen/offline/study_arm.h"
#include "codegen/offline/study_costs.h"
#include "codegen/offline/study_ik.h"
#include "codegen/offline/study_pose.h"
#include "controller/ocp/ocp_obstacles.h"
#include "tables/panda_reach/task.h"

namespace engram::offline {
namespace {

struct PandaSetup {
  using Robot = robots::Panda;
  using Field = BoxField<tasks::PandaReach>;
  static constexpr int frame = Robot::kHandTcp;
  static constexpr int space = 3;
  static constexpr double clearance = 0.02;
  static Mat3<Pack> pose(const Mat3<Pack>& R_WF) { return level(R_WF); }
  // the hand lies level: its x axis, normal to approach and finger travel, is vertical
  template <class S> static S orientation(const Mat3<S>& R_WF, Vec3<S>& moment) { return vertical_axis<S>(R_WF.column(0), moment); }
};

// Where targets are: in the shelf, above the box [m].
constexpr double kShelfLo[3] = {0.48, -0.30, 0.12}, kShelfHi[3] = {0.70, 0.30, 0.68};
constexpr double kBoxLo[3] = {0.12, 0.44, 0.30}, kBoxHi[3] = {0.32, 0.60, 0.42};

template <class F> std::unique_ptr<StudyCost> bounded(int stops, int postures, int motions) {
  using R = PandaSetup::Robot;
  auto cost = std::make_unique<StudyCostOf<F, Pack>>(F{});
  cost->ntask = 3 * stops;
  for (int i = 0; i < stops; ++i) {
    cost->lo.insert(cost->lo.end(), i == 0 ? kShelfLo : kBoxLo, (i == 0 ? kShelfLo : kBoxLo) + 3);
    cost->hi.insert(cost->hi.end(), i == 0 ? kShelfHi : kBoxHi, (i == 0 ? kShelfHi : kBoxHi) + 3);
  }
  append_joints<R>(postures, motions, cost->lo, cost->hi);
  return cost;
}

// Any pose that the reach task knows.
std::unique_ptr<StudyCost> pose() {
  using Task = tasks::PandaReach;
  constexpr double kPi = 3.14159265358979323846, kAngleLo[3] = {-0.5 * kPi, -0.5 * kPi, -0.5 * kPi}, kAngleHi[3] = {1.5 * kPi, 0.5 * kPi, 1.5 * kPi};
  auto cost = std::make_unique<StudyCostOf<PoseCost<PandaSetup>, Pack>>(PoseCost<PandaSetup>{});
  cost->ntask = kMemoryPose;
  cost->lo.assign(Task::task_lo, Task::task_lo + 3);
  cost->hi.assign(Task::task_hi, Task::task_hi + 3);
  cost->lo.insert(cost->lo.end(), kAngleLo, kAngleLo + 3);
  cost->hi.insert(cost->hi.end(), kAngleHi, kAngleHi + 3);
  append_joints<PandaSetup::Robot>(1, 0, cost->lo, cost->hi);
  return cost;
}

}  // namespace

void panda_ik(double* x, std::size_t m, int iterations) { refine_by_ik<PandaSetup>(x, m, iterations); }

std::unique_ptr<StudyCost> panda_cost(const std::string& what, const Ends& ends) {
  if (what == "transfer") return transfer_cost<PandaSetup>(ends);
  if (what == "ik") return bounded<InverseKinematicsCost<PandaSetup>>(1, 1, 0);
  if (what == "pose") return pose();
  if (what == "reach") return bounded<MotionCost<PandaSetup, 1, false>>(1, 1, 1);
  if (what == "pick") return bounded<MotionCost<PandaSetup, 2, true>>(2, 2, 3);
  return nullptr;
}

}  // namespace engram::offline
