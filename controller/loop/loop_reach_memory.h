// The memory of a reach task: asks the tables, and hands over what they propose.
#ifndef CONTROLLER_LOOP_LOOP_REACH_MEMORY_H_
#define CONTROLLER_LOOP_LOOP_REACH_MEMORY_H_

#include "controller/loop/loop_reach.h"
#include "controller/memory/memory_check.h"
#include "controller/memory/memory_query.h"

namespace engram {

// Tables: a struct with `static constexpr uint64_t digest` and `static const MemoryTables& tables()`.
template <class Task, class Tables> struct ReachMemory {
  static constexpr int kGuesses = kMemoryGuesses;
  static constexpr uint64_t kTableDigest = Tables::digest;

  MemoryWork<Task> work;
  MemoryAnswer<Task> answer;

  static bool tables_fit() {
    char text[TAB_TEXT];
    return memory_check<Task>(Tables::tables(), text) == kTabOk;
  }

  // Appends the guesses (the straight lines alone, unless `remember`) for the state x0 on N + 1 knot times t [s] to the n candidates;
  // returns their new number.
  template <class P>
  int guesses(const ReachTarget& target, bool remember, const double* x0, int N, const double* t, Candidate<P>* candidates, int n) {
    MemoryOpts opts;
    if (!remember) {
      opts.neighbours = 0;
      opts.regression = false;
    }
    memory_query<Task>(Tables::tables(), opts, target, x0, N, t, work, answer);
    for (int i = 0; i < answer.n; ++i) {
      const Guess<Task>& g = answer.guess[i];
      const engram_candidate kind = g.kind == GuessKind::kNeighbour    ? ENGRAM_CANDIDATE_KNN
                                    : g.kind == GuessKind::kRegression ? ENGRAM_CANDIDATE_GPR
                                                                       : ENGRAM_CANDIDATE_LINE;
      candidates[n++] = {kind, g.x, g.u, g.kind == GuessKind::kLine ? 0.0 : g.trust, 0.0};
    }
    return n;
  }
};

}  // namespace engram
#endif  // CONTROLLER_LOOP_LOOP_REACH_MEMORY_H_
