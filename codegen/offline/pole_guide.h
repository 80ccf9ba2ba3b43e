// A guide around the pole: targets for the hand along a way that a planner with a view of the whole task has found.
#ifndef CODEGEN_OFFLINE_POLE_GUIDE_H_
#define CODEGEN_OFFLINE_POLE_GUIDE_H_

#include "codegen/offline/pole_space.h"
#include "codegen/offline/rrt_connect.h"
#include "controller/loop/loop_talos_pole.h"

namespace engram {

class PoleGuide {
 public:
  using Space = PoleSpace<TalosPole>;
  static constexpr int kPool = 3000;

  // Plans from the posture q (nq) for the hand to go to `to` [m, world].
  RrtResult begin(const double* q, const double (&to)[3], uint64_t seed) {
    at_ = size_ = 0;
    std::memcpy(to_, to, sizeof to_);
    if (!allowed(to)) return RrtResult::kNoGoal;
    const Space space(q);
    if (!(space.margin() > 0.0)) return RrtResult::kNoStart;
    Space::Node goals[kGoals];
    const RrtResult result = rrt_.plan(space, space.start(), goals, space.reach(to, seed, goals, kGoals), seed);
    if (result != RrtResult::kFound) return result;
    rrt_.shorten(space, kCuts);
    for (size_ = 0; size_ < rrt_.size(); ++size_) space.hand(rrt_.path()[size_], way_[size_]);
    return result;
  }

  // hand: where it is [m]. p: where it shall go now, a little ahead on the way; without a way, the end.
  void lead(const double* hand, double (&p)[3]) {
    while (at_ < size_ && (distance(hand, way_[at_]) < kAhead || !allowed(way_[at_]))) ++at_;
    std::memcpy(p, at_ < size_ ? way_[at_] : to_, sizeof p);
  }

 private:
  static constexpr int kGoals = 3, kCuts = 200;
  static constexpr double kAhead = 0.12;  // m

  static bool allowed(const double* p) {
    LeggedCommand command;
    TalosPole::command(p, command);
    return TalosPole::reachable(command) && LeggedModel<TalosPole>::known(p);
  }
  static double distance(const double* a, const double* b) { return std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]); }

  RrtConnect<Space, kPool> rrt_;
  double way_[kPool][3];
  double to_[3];
  int at_ = 0, size_ = 0;
};

}  // namespace engram
#endif  // CODEGEN_OFFLINE_POLE_GUIDE_H_
