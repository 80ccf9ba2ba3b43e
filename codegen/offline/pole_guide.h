// A guide around the pole: intermediate targets for the hand, from a view wider than the controller's horizon.
//
// The arm cannot pass the pole on its far side, since the forearm would lie across it. Seen from above, whoever changes sides therefore
// passes between the shoulder and the pole: in two legs, over a way point there. Each leg is a problem that the controller's own
// solver finds its way in without help.
#ifndef CODEGEN_OFFLINE_POLE_GUIDE_H_
#define CODEGEN_OFFLINE_POLE_GUIDE_H_

#include <cmath>
#include <cstring>

#include "tables/talos_pole/task.h"

namespace engram {

class PoleGuide {
 public:
  void begin() { leg_ = -1; }

  // hand: where it is [m], to: where it shall go. True if the target p is a new one.
  bool lead(const double* hand, const double (&to)[3], double (&p)[3]) {
    const double* const pole = tasks::TalosPole::p_WO[0];
    const double via[3] = {pole[0] - kBefore, pole[1], std::fmax(0.5 * (hand[2] + to[2]) - kLower, tasks::TalosPole::task_lo[2])};
    const int before = leg_;
    if (leg_ < 0) {
      leg_ = (hand[1] - pole[1]) * (to[1] - pole[1]) < 0.0 ? 0 : 1;
      std::memcpy(via_, via, sizeof via);
    }
    if (leg_ == 0) {
      const double there = std::sqrt((hand[0] - via_[0]) * (hand[0] - via_[0]) + (hand[1] - via_[1]) * (hand[1] - via_[1]));
      if (there < kNear) leg_ = 1;
    }
    std::memcpy(p, leg_ == 0 ? via_ : to, sizeof p);
    return leg_ != before;
  }

 private:
  static constexpr double kBefore = 0.22, kLower = 0.05;  // m, of the way point before the pole and below the way
  static constexpr double kNear = 0.07;                   // m, of the way point in the plane: the next leg begins
  int leg_ = -1;
  double via_[3] = {};
};

}  // namespace engram
#endif  // CODEGEN_OFFLINE_POLE_GUIDE_H_
