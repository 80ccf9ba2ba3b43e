// Planar arms of three and four links among discs: thesis figures 7.10 to 7.13 and B.2.
#include "codegen/offline/study_costs.h"
#include "tables/planar3/robot.h"
#include "tables/planar4/robot.h"

namespace engram::offline {
namespace {

// Discs in the plane z = 0: centre and radius [m].
struct Discs3 {
  static constexpr int count = 4;
  static constexpr double disc[count][3] = {{0.7, 1.2, 0.3}, {1.6, 0.5, 0.2}, {-0.6, 1.2, 0.3}, {0.9, -0.9, 0.35}};
};
struct Discs4 {
  static constexpr int count = 5;
  static constexpr double disc[count][3] = {{0.9, 0.8, 0.25}, {1.7, -0.6, 0.3}, {-0.4, 1.5, 0.25}, {0.5, -1.2, 0.3}, {2.0, 0.6, 0.2}};
};
template <class World> struct DiscField {
  static constexpr int count = World::count;
  template <class S> static S distance(int i, const Vec3<S>& p, Vec3<S>& gradient) {
    return length<S>(p - Vec3<S>(World::disc[i][0], World::disc[i][1], 0.0), gradient) - World::disc[i][2];
  }
};

template <class R, class World> struct PlanarSetup {
  using Robot = R;
  using Field = DiscField<World>;
  static constexpr int frame = R::kTip, space = 2;
  static constexpr double clearance = 0.05;
};

template <class M> std::unique_ptr<StudyCost> planar(const std::string& what, const Ends& ends) {
  using R = typename M::Robot;
  std::unique_ptr<StudyCost> cost;
  if (what == "transfer") return transfer_cost<M>(ends);
  if (what == "ik") cost = std::make_unique<StudyCostOf<InverseKinematicsCost<M>, Pack>>(InverseKinematicsCost<M>{});
  if (what == "reach") cost = std::make_unique<StudyCostOf<MotionCost<M, 1, false>, Pack>>(MotionCost<M, 1, false>{});
  if (!cost) return nullptr;
  cost->ntask = 2;
  cost->lo = {0.9, 0.9};  // targets: a square between the discs [m]
  cost->hi = {1.9, 1.9};
  append_joints<R>(1, what == "reach" ? 1 : 0, cost->lo, cost->hi);
  return cost;
}

}  // namespace

std::unique_ptr<StudyCost> planar_cost(const std::string& robot, const std::string& what, const Ends& ends) {
  if (robot == "planar3") return planar<PlanarSetup<robots::Planar3, Discs3>>(what, ends);
  if (robot == "planar4") return planar<PlanarSetup<robots::Planar4, Discs4>>(what, ends);
  return nullptr;
}

}  // namespace engram::offline
