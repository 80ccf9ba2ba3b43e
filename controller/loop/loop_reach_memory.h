// The memory of a reach task: asks the tables, and hands over what they propose.
#ifndef CONTROLLER_LOOP_LOOP_REACH_MEMORY_H_
#define CONTROLLER_LOOP_LOOP_REACH_MEMORY_H_

#include "controller/loop/loop_reach.h"
#include "controller/memory/memory_check.h"
#include "controller/memory/memory_query.h"

#include <initializer_list>

namespace engram {

// Appends the guesses of an answer, which must outlive them, to the n candidates; returns their new number.
template <class P, class Task> int reach_candidates(const MemoryAnswer<Task>& answer, Candidate<P>* candidates, int n) {
  for (int i = 0; i < answer.n; ++i) {
    const Guess<Task>& g = answer.guess[i];
    const engram_candidate kind = g.kind == GuessKind::kNeighbour    ? ENGRAM_CANDIDATE_KNN
                                  : g.kind == GuessKind::kRegression ? ENGRAM_CANDIDATE_GPR
                                  : g.kind == GuessKind::kMixture    ? ENGRAM_CANDIDATE_GMR
                                                                     : ENGRAM_CANDIDATE_LINE;
    candidates[n++] = {kind, g.x, g.u, g.kind == GuessKind::kLine ? 0.0 : g.trust, 0.0, 0.0};
  }
  return n;
}

template <class Task, const MemoryTables& tables> struct ReachMemory {
  static constexpr int kGuesses = kMemoryGuesses;

  MemoryWork<Task> work;
  MemoryAnswer<Task> answer;

  static bool tables_fit() {
    char text[TAB_TEXT];
    return memory_check<Task>(tables, text) == kTabOk;
  }
  static uint64_t table_digest() {
    uint64_t digest = 0;
    for (const TabHead* head :
         {&tables.knn->head, &tables.gpr->head, &tables.bow->head, &tables.time->head, &tables.trust->head}) {
      digest = (digest ^ head->digest) * 0x100000001b3;  // as FNV-1a
    }
    if (tables.mixture != nullptr) digest = (digest ^ tables.mixture->head.digest) * 0x100000001b3;
    return digest;
  }

  // Appends the guesses (the straight lines alone, unless `remember`; `elsewhere`: as in MemoryOpts) for the state x0 on N + 1 knot times t [s] to the n candidates;
  // returns their new number.
  template <class P> int guesses(const ReachTarget& target, bool remember, int64_t elsewhere, const double* x0, int N, const double* t,
                                 Candidate<P>* candidates, int n) {
    MemoryOpts opts;
    opts.elsewhere = elsewhere;
    if (!remember) {
      opts.neighbours = opts.mixtures = 0;
      opts.regression = false;
    }
    memory_query<Task>(tables, opts, target, x0, N, t, work, answer);
    return reach_candidates(answer, candidates, n);
  }
};

}  // namespace engram
#endif  // CONTROLLER_LOOP_LOOP_REACH_MEMORY_H_
