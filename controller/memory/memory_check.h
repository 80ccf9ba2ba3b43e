// Start-up check of a memory's tables.
#ifndef CONTROLLER_MEMORY_MEMORY_CHECK_H_
#define CONTROLLER_MEMORY_MEMORY_CHECK_H_

#include "controller/memory/memory_features.h"
#include "controller/memory/memory_train.h"

namespace engram {

template <class Task> TabStatus memory_check(const MemoryTables& tables, char* text) {
  using R = typename Task::Robot;
  const auto head = [](const auto* table) { return table ? &table->head : nullptr; };
  const struct {
    const TabHead* head;
    TabKind kind;
  } expected[] = {{head(tables.knn), kTabKnn}, {head(tables.gpr), kTabGpr}, {head(tables.bow), kTabPca},
                  {head(tables.time), kTabRbf}, {head(tables.trust), kTabLogit}};
  for (const auto& table : expected) {
    if (tab_check(table.head, table.kind, R::digest, Task::digest, text) != kTabOk) return kTabBad;
  }
  bool learners = true;
  for (const TabHead* learner : tables.learner) {
    if (learner == nullptr) continue;
    const TabKind kind = learner->kind == kTabMlp ? kTabMlp : kTabGmr;
    if (tab_check(learner, kind, R::digest, Task::digest, text) != kTabOk) return kTabBad;
    learners = learners && learner->nin == kMemoryFeatures<Task> && learner->nout > R::nq && learner->nout <= R::nq + tables.bow->m;
  }
  if (tables.train != nullptr && tab_check(&tables.train->head, kTabTt, R::digest, Task::digest, text) != kTabOk) return kTabBad;
  const int m = tables.bow->m;
  const bool fit = tables.knn->d == kMemoryFeatures<Task> && tables.knn->m == R::nq + m &&  //
                   tables.gpr->d == kMemoryBowFeatures<Task> && tables.gpr->m == m && m <= kMemoryMaxBow &&
                   tables.time->nchannel == R::nq + R::nu && tables.bow->n == tables.time->k * (R::nq + R::nu) &&
                   tables.trust->d == kMemoryTrustInputs &&
                   learners &&
                   (tables.train == nullptr || (tables.train->d == kMemoryPose + R::nq &&
                                                tab_tt_sampler_bytes(tables.train, kMemoryTrainSamples) <= kMemoryTrainBytes));
  if (fit) return kTabOk;
  constexpr char kMisfit[] = "the memory's tables do not fit each other; run 'make tables' and build again";
  static_assert(sizeof kMisfit <= TAB_TEXT, "fits the caller's buffer");
  for (size_t i = 0; i < sizeof kMisfit; ++i) text[i] = kMisfit[i];
  return kTabBad;
}

}  // namespace engram
#endif  // CONTROLLER_MEMORY_MEMORY_CHECK_H_
