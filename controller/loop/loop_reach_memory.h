// The memory of a reach task: asks the tables, and hands over what they propose.
#ifndef CONTROLLER_LOOP_LOOP_REACH_MEMORY_H_
#define CONTROLLER_LOOP_LOOP_REACH_MEMORY_H_

#include "controller/loop/loop_reach.h"
#include "controller/memory/memory_check.h"
#include "controller/memory/memory_query.h"

#include <initializer_list>

namespace engram {

// By GuessKind.
inline constexpr engram_candidate kReachCandidate[kGuessKinds] = {ENGRAM_CANDIDATE_KNN, ENGRAM_CANDIDATE_GPR, ENGRAM_CANDIDATE_LINE,
                                                                  ENGRAM_CANDIDATE_GMR, ENGRAM_CANDIDATE_TT,  ENGRAM_CANDIDATE_MLP};

// Appends the guesses of an answer, which must outlive them, to the n candidates; returns their new number.
template <class P, class Task> int reach_candidates(const MemoryAnswer<Task>& answer, Candidate<P>* candidates, int n) {
  for (int i = 0; i < answer.n; ++i) {
    const Guess<Task>& g = answer.guess[i];
    candidates[n++] = {kReachCandidate[int(g.kind)], g.x, g.u, g.kind == GuessKind::kLine ? 0.0 : g.trust, 0.0, 0.0};
  }
  return n;
}

template <class Task, const MemoryTables& tables> struct ReachMemory {
  static constexpr int kGuesses = kMemoryGuesses;

  MemoryWork<Task> work;
  MemoryAnswer<Task> answer;

  ReachMemory() { memory_init(tables, work); }

  static bool tables_fit() {
    char text[TAB_TEXT];
    return memory_check<Task>(tables, text) == kTabOk;
  }
  static uint64_t table_digest() {
    uint64_t digest = 0;
    const auto add = [&digest](const TabHead* head) {
      if (head != nullptr) digest = (digest ^ head->digest) * 0x100000001b3;  // as FNV-1a
    };
    for (const TabHead* head : {&tables.knn->head, &tables.gpr->head, &tables.bow->head, &tables.time->head, &tables.trust->head}) add(head);
    for (const TabHead* head : tables.learner) add(head);
    add(tables.train != nullptr ? &tables.train->head : nullptr);
    return digest;
  }

  // Appends the guesses for the state x0 on N + 1 knot times t [s] to the n candidates; returns their new number.
  template <class P> int guesses(const ReachTarget& target, const Question& question, const double* x0, int N, const double* t,
                                 Candidate<P>* candidates, int n) {
    MemoryOpts opts = tables.ensemble;
    opts.elsewhere = question.elsewhere;
    opts.clock = question.clock;
    if (!question.remember) {
      opts.neighbours = opts.modes = opts.trains = 0;
      opts.regression = false;
    }
    memory_query<Task>(tables, opts, target, x0, N, t, work, answer);
    for (int kind = 0; kind < kGuessKinds; ++kind) question.us[kReachCandidate[kind]] = answer.us[kind];
    return reach_candidates(answer, candidates, n);
  }
};

}  // namespace engram
#endif  // CONTROLLER_LOOP_LOOP_REACH_MEMORY_H_
