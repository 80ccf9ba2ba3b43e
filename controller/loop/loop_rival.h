// A rival to the shifted plan: what a memory proposes for the horizon as it is posed, improved on its own, and judged by what it costs rolled out.
//
// A plan that has come to rest before an obstacle stays there: its shift is a local minimum, and an iteration leaves it where it is. A rival
// starts elsewhere. The memory is asked at every tick. The rival has M::Memory::kIterations iterations of each tick, its trajectory shifted
// in between as the plan's is; it begins anew from the answer if that has the lower merit as it stands, and after M::Memory::kPatience ticks.
// It takes the plan's place if at the last sweep of a tick it costs less than the shifted plan, both rolled out without gaps and with the
// gains of a sweep at themselves (loop_rolled.h), and never otherwise: by its merit a plan whose gaps are open looks good that would swing
// the arm into what it is stuck at. No switch_gain: waiting for a tenth less let it do so.
// Where the robot has arrived, the answer is iterated on only if as it stands it has a lower merit than the shifted plan.
// A memory has
//
//   static constexpr bool kRemembers;  static constexpr int kIterations, kPatience;
//   static bool arrived(target, x0)   true where the shifted plan has nothing left to do
//   bool guess(target, seq, const Plan& shifted, Seed&)   a trajectory on the shifted plan's knot times and from its state; false: none.
//                                                         seq counts ticks: those who know several ways offer them in turn
#ifndef CONTROLLER_LOOP_LOOP_RIVAL_H_
#define CONTROLLER_LOOP_LOOP_RIVAL_H_

#include "controller/loop/loop_merit.h"
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

  // Asks the memory. False if there is nothing to go on from.
  bool ask(const typename M::Target& target, int64_t seq, const Solve<M>& shifted) {
    arrived_ = M::Memory::arrived(target, shifted.horizon.x0);
    if (arrived_ || age_ >= M::Memory::kPatience) age_ = 0;
    answered_ = memory_.guess(target, seq, shifted.plan, answer_) && all_finite(answer_.x[0], (N + 1) * M::P::nx) && all_finite(answer_.u[0], N * M::P::nu);
    return answered_ || age_ > 0;
  }
  // Iterates on the horizon of the shifted plan, and judges at the sweep of the last iteration. True if it is to take that one's place.
  template <class Extend> bool better(const Solve<M>& shifted, Deadline& deadline, Extend extend) {
    cost_[0] = HUGE_VAL;
    cost_[1] = shifted.merit();
    if (arrived_) {
      cost_[0] = merits(shifted).answer;
      if (!(cost_[0] < cost_[1])) return false;
    } else if (age_ > 0) {
      resample(solve_.plan, shifted.plan.utime, shifted.horizon.x0, carried_, extend);
      if (answered_) {
        const Merits as_they_stand = merits(shifted);
        if (!(as_they_stand.carried <= as_they_stand.answer)) age_ = 0;
      }
    }
    const Seed<typename M::P, N>& start = age_ > 0 ? carried_ : answer_;
    solve_.horizon = shifted.horizon;
    solve_.plan.n = N;
    std::memcpy(solve_.plan.utime, shifted.plan.utime, sizeof(solve_.plan.utime));
    solve_.clear();
    solve_.start(start.x, start.u, age_ > 0 ? solve_.reg() : 0.0);
    ++age_;
    if (solve_.improve(M::Memory::kIterations - 1, deadline, [] {}) && solve_.ready()) {
      if (cheaper(shifted)) return true;
      if (solve_.improve(1, deadline, [] {}, true)) return false;
    }
    age_ = 0;
    return false;
  }
  void forget() { age_ = 0; }
  double cost() const { return cost_[0]; }
  double cost_of_shifted() const { return cost_[1]; }
  // What is better becomes the plan, as it was swept.
  void take_over(Solve<M>& shifted) {
    age_ = 0;
    shifted.become(solve_);
  }

 private:
  bool cheaper(const Solve<M>& shifted) {
    loop_rolled(shifted.horizon, solve_.plan.s, shifted.plan.s, cost_);
    if (!std::isfinite(cost_[0])) cost_[0] = HUGE_VAL;
    return std::isfinite(cost_[0]) && !(cost_[0] >= cost_[1]);
  }

  struct Merits {
    double answer, carried;
  };
  Merits merits(const Solve<M>& shifted) const {
    Candidate<typename M::P> both[2] = {{ENGRAM_CANDIDATE_KNN, answer_.x, answer_.u, 0.0, 0.0, 0.0}, {ENGRAM_CANDIDATE_KNN, carried_.x, carried_.u, 0.0, 0.0, 0.0}};
    loop_merit<typename M::P, N>(shifted.horizon, both, age_ > 0 ? 2 : 1);
    return {both[0].merit, both[1].merit};
  }

  Seed<typename M::P, N> answer_, carried_;  // what the memory has just answered; the rival so far, on this tick's knots
  Solve<M> solve_;
  bool arrived_ = false, answered_ = false;
  int age_ = 0;  // ticks that the trajectory has been iterated in
  double cost_[2] = {HUGE_VAL, HUGE_VAL};  // of the rival, of the shifted plan
  typename M::Memory memory_;
};

template <class M> class Rival<M, false> {
 public:
  explicit Rival(const engram_options&) {}
};

}  // namespace engram
#endif  // CONTROLLER_LOOP_LOOP_RIVAL_H_
