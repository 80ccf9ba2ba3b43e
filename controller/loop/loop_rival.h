// A rival to the shifted plan: what a memory proposes for the horizon as it is posed, improved on its own, and judged by its merit.
//
// A plan that has come to rest before an obstacle stays there: its shift is a local minimum, and an iteration leaves it where it is. A rival
// starts elsewhere. It has M::Memory::kIterations iterations of each tick for M::Memory::kPatience ticks, its trajectory shifted in between
// as the plan's is; then the memory is asked anew. It takes the plan's place as soon as its merit (cost + kMeritWeight * gaps) is below the
// shifted plan's and it costs no more rolled out (loop_rolled.h), and never otherwise. No switch_gain: waiting for a tenth less let a stuck
// arm push on into what it was stuck at.
// A memory has
//
//   static constexpr bool kRemembers;  static constexpr int kIterations, kPatience;
//   static bool needless(target, x0)   true where the shifted plan alone does: nothing is asked or iterated
//   bool guess(target, seq, const Plan& shifted, Seed&)   a trajectory on the shifted plan's knot times and from its state; false: none.
//                                                         seq counts ticks: those who know several ways offer them in turn
#ifndef CONTROLLER_LOOP_LOOP_RIVAL_H_
#define CONTROLLER_LOOP_LOOP_RIVAL_H_

#include "controller/loop/loop_rolled.h"
#include "controller/loop/loop_solve.h"

namespace engram {

// The memory of a model that has none.
struct NoMemory {
  static constexpr bool kRemembers = false, kContinues = false;
  static bool tables_fit() { return true; }
  static uint64_t table_digest() { return 0; }
};

template <class M, bool = M::Memory::kRemembers> class Rival {
 public:
  static constexpr int N = M::N;

  explicit Rival(const engram_options& options) : solve_(options) {}

  // False if there is none, or if none is needed. extend(k, x, u, x_next): how a trajectory goes on beyond its end.
  template <class Extend> bool ask(const typename M::Target& target, int64_t seq, const Solve<M>& shifted, Extend extend) {
    if (M::Memory::needless(target, shifted.horizon.x0)) return age_ = 0, false;
    if (age_ >= M::Memory::kPatience) age_ = 0;
    reg_ = age_ > 0 ? solve_.reg() : 0.0;
    if (age_ > 0) resample(solve_.plan, shifted.plan.utime, shifted.horizon.x0, seed_, extend);
    else if (!memory_.guess(target, seq, shifted.plan, seed_)) return false;
    return all_finite(seed_.x[0], (N + 1) * M::P::nx) && all_finite(seed_.u[0], N * M::P::nu) ? true : (age_ = 0, false);
  }
  // Iterates on the horizon of the shifted plan.
  void improve(const Solve<M>& shifted, Deadline& deadline) {
    solve_.horizon = shifted.horizon;
    solve_.plan.n = N;
    std::memcpy(solve_.plan.utime, shifted.plan.utime, sizeof(solve_.plan.utime));
    solve_.clear();
    solve_.start(seed_.x, seed_.u, reg_);
    sound_ = solve_.improve(M::Memory::kIterations, deadline, [] {}) && std::isfinite(solve_.plan.s.cost);
    age_ = sound_ ? age_ + 1 : 0;
  }
  void forget() { age_ = 0; }
  double merit() const { return sound_ ? solve_.merit() : HUGE_VAL; }
  const FddpStats& stats() const { return solve_.stats; }
  // Rolled out without gaps it costs no more than the shifted plan; one that does not stay finite costs more than any that does.
  bool cheaper(const Solve<M>& shifted) const {
    double cost[2];
    loop_rolled(shifted.horizon, solve_.plan.s, shifted.plan.s, cost);
    return std::isfinite(cost[0]) && !(cost[0] > cost[1]);
  }
  // The rival becomes the plan, swept once more. False if that failed.
  bool take_over(Solve<M>& shifted) {
    age_ = 0;
    shifted.start(solve_.plan.s.x, solve_.plan.s.u, solve_.reg());
    return shifted.ready();
  }

 private:
  Seed<typename M::P, N> seed_;
  Solve<M> solve_;
  bool sound_ = false;
  int age_ = 0;       // ticks that the trajectory has been iterated in
  double reg_ = 0.0;
  typename M::Memory memory_;
};

template <class M> class Rival<M, false> {
 public:
  explicit Rival(const engram_options&) {}
};

}  // namespace engram
#endif  // CONTROLLER_LOOP_LOOP_RIVAL_H_
