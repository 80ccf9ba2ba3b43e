// The model of a reach task, as the loop sees any task: problem, knots, obstacles, memory.
#ifndef CONTROLLER_LOOP_LOOP_REACH_H_
#define CONTROLLER_LOOP_LOOP_REACH_H_

#include "controller/loop/loop_hold.h"
#include "controller/loop/loop_merit.h"
#include "controller/ocp/ocp_reach.h"

namespace engram {

// Memory_: where guesses come from (loop_reach_memory.h).
template <class Task_, class Memory_> struct ReachModel {
  using Task = Task_;
  using Memory = Memory_;
  using R = typename Task::Robot;
  using P = Reach<Task>;
  using Knot = typename P::template Knot<double>;
  using Target = ReachTarget;
  using Hold = DrivenHold<P>;
  static constexpr int N = Task::nknots;
  static constexpr int ntask = Task::ntask;
  static constexpr int kIterations = 4;  // per period
  static constexpr double kLargestNearGap = 0.1, kLargestGap = 0.5, kLargestSpeed = 1.0;  // loop_core.h
  static constexpr int64_t kStepUs = static_cast<int64_t>(1e6 * Task::dt + 0.5);
  static constexpr int64_t kTickUs = 10000;
  static_assert(kStepUs % kTickUs == 0, "a knot is a whole number of ticks");

  static bool target(const double* value, Target& t) { return reach_target(value, t); }
  // True within the range the memory was built for.
  static bool known(const double* value) {
    for (int i = 0; i < ntask; ++i)
      if (!(value[i] >= Task::task_lo[i] && value[i] <= Task::task_hi[i])) return false;
    return true;
  }
  static void knot(const Target& t, double dt, double since_jump, Knot& k) { reach_knot<Task>(t, dt, since_jump, k); }
  // True if the state x is within `share` of what counts as success.
  static bool arrived(const Target& t, const double* x, double share) {
    Mat3<double> R_WH;
    Vec3<double> p;
    reach_hand<Task, double>(x, R_WH, p);
    double off2 = 0.0, trace = 0.0;  // |p - p*|^2 and tr(R*' R) = 1 + 2 cos(angle)
    for (int i = 0; i < 3; ++i) off2 += (p[i] - t.p[i]) * (p[i] - t.p[i]);
    for (int i = 0; i < 9; ++i) trace += t.R[i] * R_WH(i / 3, i % 3);
    const double off = share * Task::success_position, angle = share * Task::success_rotation;
    return off2 <= off * off && trace >= 1.0 + 2.0 * std::cos(angle);
  }
  // True if a motion may well end in the state x: well within what counts as success, and with the margin to the obstacles that the
  // problem asks for. Where the margin must yield to the target, the target will have to yield to the margin later on.
  static bool ends_well(const Target& t, const double* x) {
    return arrived(t, x, 0.5) && clearance<double>(x) >= 0.8 * Task::margin_collision;
  }
  template <class S> static S clearance(const S* q) { return reach_clearance<Task, S>(q); }
  template <class S> static void hand(const S* q, S* p_WH) {
    Mat3<S> R_WH;
    Vec3<S> p;
    reach_hand<Task, S>(q, R_WH, p);
    for (int i = 0; i < 3; ++i) p_WH[i] = p[i];
  }
};

// A memory that knows nothing.
template <class Task> struct NoReachMemory {
  static constexpr int kGuesses = 0;
  static bool tables_fit() { return true; }
  static uint64_t table_digest() { return 0; }
  template <class P> int guesses(const ReachTarget&, const Question&, const double*, int, const double*, Candidate<P>*, int n) { return n; }
};

}  // namespace engram
#endif  // CONTROLLER_LOOP_LOOP_REACH_H_
