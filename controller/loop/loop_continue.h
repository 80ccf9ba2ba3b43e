// How else the shifted plan may go on: the knots that enter the horizon as a memory has them, if the solver's seed is the better for it.
//
// A knot that enters has no plan yet, and the model's own guess of it stands still. A memory that knows what comes has
//
//   static constexpr bool kContinues = true;
//   M::go_on(int kept, Memory&, Seed&, extend)   its own knots from `kept` on; extend(k, x, u, x_next): the model's; false: no guess
//
// The seed of lower merit (loop_merit.h) starts the solver: never one that is worse than the shifted plan.
#ifndef CONTROLLER_LOOP_LOOP_CONTINUE_H_
#define CONTROLLER_LOOP_LOOP_CONTINUE_H_

#include "controller/loop/loop_solve.h"

namespace engram {

template <class M, bool = M::Memory::kContinues> class Continuation {
 public:
  using P = typename M::P;
  static constexpr int N = M::N;

  // The better one of `seed`, whose first `kept` knots are the shifted plan's, and of these as the memory goes on. `cycle` says how they
  // compare.
  template <class Extend>
  const Seed<P, N>& better(const M& model, const Horizon<P, N>& h, int kept, const Seed<P, N>& seed, const Deadline& deadline, Extend extend,
                           engram_cycle& cycle) {
    const double begin = deadline.now();
    guess_ = seed;
    const bool found = model.go_on(kept, memory_, guess_, extend);
    const double answered = deadline.now();
    cycle.asked_us[ENGRAM_CANDIDATE_GPR] = answered - begin;
    cycle.query_us += answered - begin;
    if (!found) return seed;
    Candidate<P> both[] = {{ENGRAM_CANDIDATE_SHIFTED, seed.x, seed.u, 0.0, 0.0, 0.0}, {ENGRAM_CANDIDATE_GPR, guess_.x, guess_.u, 0.0, 0.0, 0.0}};
    loop_merit<P, N>(h, both, 2);
    cycle.nguess = 2;
    for (int i = 0; i < 2; ++i) {
      cycle.guess[i] = both[i].kind;
      cycle.merit[i] = both[i].merit;
    }
    const int best = both[1].merit < both[0].merit;
    cycle.winner = both[best].kind;
    cycle.candidates_us = deadline.now() - answered;
    return best == 0 ? seed : guess_;
  }

 private:
  Seed<P, N> guess_;
  typename M::Memory memory_;
};

template <class M> class Continuation<M, false> {};

}  // namespace engram
#endif  // CONTROLLER_LOOP_LOOP_CONTINUE_H_
