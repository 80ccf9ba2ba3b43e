// A goal to be at, again and again: what models of the receding planner share whose knots all ask for the same thing.
#ifndef CONTROLLER_LOOP_LOOP_WAY_H_
#define CONTROLLER_LOOP_LOOP_WAY_H_

#include "controller/loop/loop_receding.h"

#include <algorithm>
#include <cstdint>

namespace engram {

// A model `Self` on top of it says what a knot asks for, and what the controls are when nothing is asked:
//
//   void aim(const double* x0, bool fresh)                    the state expected at the first knot; fresh: the target is new
//   void knot(double dt, bool end, int k, Knot&) const        problem of knot k, dt [s] long
//   static constexpr double rest(int i)                       control i
//   static bool target(const double* value, Target&), path(const double* x, double (&p)[3]); Hold
template <class Self, class Task_, class P_, class Target_> class WayModel {
 public:
  using Task = Task_;
  using R = typename Task::Robot;
  using P = P_;
  using Knot = typename P::template Knot<double>;
  using Memory = NoMemory;
  using Target = Target_;
  static constexpr int N = Task::nknots, ntask = Task::ntask, kIterations = 1;
  static constexpr int64_t kStepUs = static_cast<int64_t>(1e6 * Task::dt + 0.5), kTickUs = 10000;
  static constexpr bool kBoxedControls = true;
  // A gust opens gaps: the plan of before it would be worse than any. There are no limits of speed.
  static constexpr double kLargestNearGap = 1e3, kLargestGap = 1e3, kLargestSpeed = 1e3;
  static_assert(kStepUs % kTickUs == 0, "a knot is a whole number of ticks");

  static bool known(const double* value) {
    for (int i = 0; i < ntask; ++i)
      if (!(value[i] >= Task::task_lo[i] && value[i] <= Task::task_hi[i])) return false;
    return true;
  }

  static void tell(engram_legs&) {}  // it has none

  void begin(int64_t, const double*) {}
  void take(int64_t, const Target& t) {
    target_ = t;
    fresh_ = true;
  }
  void pose(const int64_t (&utime)[N + 1], const double* x0, Horizon<P, N>& h) {
    self().aim(x0, fresh_);
    fresh_ = false;
    for (int k = 0; k <= N; ++k) {
      const double dt = k < N ? 1e-6 * static_cast<double>(utime[k + 1] - utime[k]) : 0.0;
      self().knot(dt, k == N, k, h.knot[k]);
    }
  }
  void extend(const Horizon<P, N>& h, int k, const double* x, double* u, double* x_next) const {
    double cost;
    for (int i = 0; i < P::nu; ++i) u[i] = Self::rest(i);
    P::calc(h.knot[k], x, u, x_next, cost);
  }

 protected:
  Target target_;

 private:
  Self& self() { return static_cast<Self&>(*this); }
  bool fresh_ = true;
};

}  // namespace engram
#endif  // CONTROLLER_LOOP_LOOP_WAY_H_
