// The memory as a metric: of several goals, the one to which the memory holds the cheapest way. Nothing is solved.
//
//   for every goal: its best guess, and the merit of that; the goal of lowest merit wins
//
// Source: thesis, algorithm 2. (Its algorithm 3, an ensemble of guesses that are solved side by side until one succeeds, is the
// planner's answer to a jump: engram_options::starts guesses that end in different postures are iterated, and the best is taken.)
#ifndef CONTROLLER_LOOP_LOOP_GOALS_H_
#define CONTROLLER_LOOP_LOOP_GOALS_H_

#include "controller/loop/loop_merit.h"

namespace engram {

// Scratch of one choice. kGuesses: most guesses for one goal.
template <class M, int kGuesses> struct GoalChoice {
  Horizon<typename M::P, M::N> horizon;
  Candidate<typename M::P> candidate[kGuesses];
  double t[M::N + 1];
};

// Index of the goal of lowest merit among `n`, the first among equals; -1 if there is no guess for any.
//
//   x0     (nx)  state, from which every goal is to be reached in whole knots
//   ask    ask(goal, t, candidates) -> number of guesses, at most kGuesses; t (N + 1) knot times from now [s]
//   merit  (n)   out: of the best guess for each goal; +infinity without one
template <class M, int kGuesses, class Ask>
int loop_choose_goal(const typename M::Target* goal, int n, const double* x0, Ask ask, double* merit, GoalChoice<M, kGuesses>& s) {
  constexpr double dt = 1e-6 * static_cast<double>(M::kStepUs);
  s.horizon.n = M::N;
  std::memcpy(s.horizon.x0, x0, sizeof(s.horizon.x0));
  for (int k = 0; k <= M::N; ++k) s.t[k] = k * dt;
  int best = -1;
  for (int g = 0; g < n; ++g) {
    for (int k = 0; k <= M::N; ++k) M::knot(goal[g], k < M::N ? dt : 0.0, s.t[k], s.horizon.knot[k]);
    const int count = ask(goal[g], s.t, s.candidate);
    if (count > 0) loop_merit(s.horizon, s.candidate, count);
    merit[g] = HUGE_VAL;
    for (int i = 0; i < count; ++i) merit[g] = std::fmin(merit[g], s.candidate[i].merit);
    if (merit[g] < (best < 0 ? HUGE_VAL : merit[best])) best = g;
  }
  return best;
}

}  // namespace engram
#endif  // CONTROLLER_LOOP_LOOP_GOALS_H_
