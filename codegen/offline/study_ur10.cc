// The UR10 with its tool upright: the eight solutions of thesis 7.5.2, figure 7.9.
#include "codegen/offline/study_costs.h"
#include "codegen/offline/study_ik.h"
#include "tables/ur10/robot.h"

namespace engram::offline {
namespace {

struct NoObstacles {
  static constexpr int count = 0;
};

struct Ur10Setup {
  using Robot = robots::Ur10;
  using Field = NoObstacles;
  static constexpr int frame = Robot::kTool, space = 3;
  static constexpr double clearance = 0.0;
  static Mat3<Pack> pose(const Mat3<Pack>&) { return Mat3<double>::Identity().cast<Pack>(); }
  template <class S> static S orientation(const Mat3<S>& R_WF, Vec3<S>& moment) { return axes_of_world<S>(R_WF, moment); }
};

constexpr double kReach = 1.3, kHighest = 1.2, kPi = 3.14159265358979323846;  // box around the workspace [m]; one turn of each joint

}  // namespace

void ur10_ik(double* x, std::size_t m, int iterations) { refine_by_ik<Ur10Setup>(x, m, iterations); }

std::unique_ptr<StudyCost> ur10_cost(const std::string& what) {
  if (what != "ik") return nullptr;
  using F = InverseKinematicsCost<Ur10Setup>;
  auto cost = std::make_unique<StudyCostOf<F, Pack>>(F{});
  cost->ntask = F::ntask;
  cost->lo = {-kReach, -kReach, -0.6};
  cost->hi = {kReach, kReach, kHighest};
  cost->lo.resize(F::d, -kPi);
  cost->hi.resize(F::d, kPi);
  return cost;
}

}  // namespace engram::offline
