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

// Index of the goal of lowest merit among `n`, the first among equals; -1 if there is no guess for any.
//
//   x0         (nx)  state, from which every goal is to be reached in whole knots
//   ask        ask(goal, t, candidates) -> number of guesses; t (N + 1) knot times from now [s]
//   merit      (n)   out: of the best guess for each goal; +infinity without one
//   horizon, candidates   scratch; as many candidates as `ask` may have guesses
template <class M, class Ask>
int loop_choose_goal(const typename M::Target* goal, int n, const double* x0, Ask ask, double* merit, Horizon<typename M::P, M::N>& horizon,
                     Candidate<typename M::P>* candidates) {
  constexpr double dt = 1e-6 * static_cast<double>(M::kStepUs);
  double t[M::N + 1];
  horizon.n = M::N;
  std::memcpy(horizon.x0, x0, sizeof(horizon.x0));
  for (int k = 0; k <= M::N; ++k) t[k] = k * dt;
  int best = -1;
  for (int g = 0; g < n; ++g) {
    for (int k = 0; k <= M::N; ++k) M::knot(goal[g], k < M::N ? dt : 0.0, t[k], horizon.knot[k]);
    const int count = ask(goal[g], t, candidates);
    if (count > 0) loop_merit(horizon, candidates, count);
    merit[g] = HUGE_VAL;
    for (int i = 0; i < count; ++i) merit[g] = std::fmin(merit[g], candidates[i].merit);
    if (merit[g] < (best < 0 ? HUGE_VAL : merit[best])) best = g;
  }
  return best;
}

}  // namespace engram
#endif  // CONTROLLER_LOOP_LOOP_GOALS_H_
