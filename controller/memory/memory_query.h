// One query of the memory, in five steps: look up, find end postures, decode, bend, make it a motion.
#ifndef CONTROLLER_MEMORY_MEMORY_QUERY_H_
#define CONTROLLER_MEMORY_MEMORY_QUERY_H_

#include "controller/ik/ik_pose.h"
#include "controller/memory/memory_features.h"
#include "controller/memory/memory_warp.h"

#include <cmath>

namespace engram {

template <class Task> struct MemoryWork {
  using R = typename Task::Robot;
  static constexpr int N = Task::nknots;
  // A guess in the making.
  struct Slot {
    GuessKind kind;
    int32_t source;
    const float* remembered;  // end posture (nq), coefficients of the bow; null: no bow
    double distance;          // of its sample [-]
    double start[R::nq];      // where inverse kinematics starts
    double end[R::nq];        // where it ends: the goal posture
    bool reached;             // within kMemoryIkTolerance
    double trust_inputs[kMemoryTrustInputs];
  };
  Slot slot[kMemoryGuesses + kLanes];  // padded with copies to whole packs
  double features[kMemoryFeatures<Task>];
  int32_t index[kMemoryNeighbours];
  float distance2[kMemoryNeighbours];
  alignas(64) float regression[kMemoryMaxOutputs];
  alignas(64) float weights[TAB_RBF_MAX_K * R::nq + TAB_LANES];  // of a bow
  double basis[(N + 1) * TAB_RBF_MAX_K];
  double bow[N + 1][R::nq];
  Pack path[N + 1][R::nq];  // kLanes guesses side by side
  RbdData<R, Pack> rbd;
};

inline constexpr double kMemoryIkTolerance = 1e-3;  // [m, rad] an end farther from the goal counts as not reached
inline constexpr double kMemoryFar = 1e3;           // distance that stands for "no sample at all"

// The steps of memory_query.
namespace memory {

inline bool finite(const double* x, int n) {
  for (int i = 0; i < n; ++i) {
    if (!std::isfinite(x[i])) return false;
  }
  return true;
}

// Nearest samples, regression and lines -> w.slot; returns how many.
template <class Task>
int look_up(const MemoryTables& tables, const MemoryOpts& opts, const ReachTarget& goal, const double* x0, MemoryWork<Task>& w,
            MemoryAnswer<Task>& answer) {
  using R = typename Task::Robot;
  int slots = 0;
  const auto add = [&](GuessKind kind, int32_t source, const float* remembered, double distance) {
    auto& slot = w.slot[slots++];
    slot.kind = kind;
    slot.source = source;
    slot.remembered = remembered;
    slot.distance = distance;
    if (remembered != nullptr) {
      for (int i = 0; i < R::nq; ++i) slot.start[i] = remembered[i];
    }
  };
  memory_features<Task>(x0, goal, w.features);
  if (opts.neighbours > 0) {
    answer.status = tab_knn_query(tables.knn, w.features, opts.neighbours, w.index, w.distance2);
    answer.distance = std::sqrt(w.distance2[0]);
    for (int i = 0; i < opts.neighbours && w.index[i] >= 0; ++i) {
      add(GuessKind::kNeighbour, w.index[i], tab_knn_value(tables.knn, w.index[i]), std::sqrt(w.distance2[i]));
    }
  }
  if (opts.regression) {
    float variance;
    answer.status = tab_worse(answer.status, tab_gpr_query(tables.gpr, w.features, w.regression, &variance));
    answer.deviation = std::sqrt(variance / (tables.gpr->variance + tables.gpr->noise));
    add(GuessKind::kRegression, 0, w.regression, answer.distance);
  }
  for (int line = 0; line < opts.lines; ++line) {
    if (line == 0 && (slots == 0 || w.slot[0].kind != GuessKind::kNeighbour)) continue;
    add(GuessKind::kLine, line, nullptr, answer.distance);
    const double* start = line == 0 ? w.slot[0].start : line == 1 ? R::q_home : x0;
    for (int i = 0; i < R::nq; ++i) w.slot[slots - 1].start[i] = start[i];
  }
  return slots;
}

// Inverse kinematics from every slot's start, kLanes at a time -> end, reached.
template <class Task> void find_ends(const ReachTarget& goal, int slots, MemoryWork<Task>& w) {
  using R = typename Task::Robot;
  for (int first = 0; first < slots; first += kLanes) {
    Pack q[R::nq];
    for (int l = 0; l < kLanes; ++l) {
      const auto& slot = w.slot[first + l < slots ? first + l : first];
      for (int i = 0; i < R::nq; ++i) q[i].l[l] = slot.start[i];
    }
    const Pack error = ik_pose<R, Task::frame>(goal, q, w.rbd);
    for (int l = 0; l < kLanes && first + l < slots; ++l) {
      auto& slot = w.slot[first + l];
      for (int i = 0; i < R::nq; ++i) slot.end[i] = q[i].l[l];
      slot.reached = error.l[l] < kMemoryIkTolerance;
    }
  }
}

// Trust and warp of a slot -> guess; false if its end is bent too far.
template <class Task>
bool judge(const MemoryTables& tables, const MemoryOpts& opts, double deviation, typename MemoryWork<Task>::Slot& slot,
           Guess<Task>& guess) {
  guess.kind = slot.kind;
  guess.source = slot.source;
  guess.warp = 0;
  for (int i = 0; i < Task::Robot::nq; ++i) guess.warp = std::fmax(guess.warp, std::fabs(slot.end[i] - slot.start[i]));
  memory_trust_inputs(std::fmin(slot.distance, kMemoryFar), deviation, guess.warp, slot.kind, slot.trust_inputs);
  guess.trust = 0;
  if (slot.reached) tab_logit_eval(tables.trust, slot.trust_inputs, &guess.trust);
  return slot.kind == GuessKind::kLine || (slot.reached && guess.warp <= opts.max_warp);
}

// The bow of a slot at the knots -> lane l of w.path
template <class Task>
void decode_bow(const MemoryTables& tables, const typename MemoryWork<Task>::Slot& slot, int n, int l, MemoryWork<Task>& w) {
  constexpr int nq = Task::Robot::nq;
  if (slot.remembered == nullptr) {
    for (int k = 0; k <= n; ++k)
      for (int i = 0; i < nq; ++i) w.path[k][i].l[l] = 0;
    return;
  }
  tab_pca_decode(tables.bow, slot.remembered + nq, w.weights);
  tab_rbf_eval(tables.time, w.weights, 0, nq, n + 1, w.basis, w.bow[0]);
  for (int k = 0; k <= n; ++k)
    for (int i = 0; i < nq; ++i) w.path[k][i].l[l] = w.bow[k][i];
}

}  // namespace memory

template <class Task>
void memory_query(const MemoryTables& tables, const MemoryOpts& opts, const ReachTarget& goal, const double* x0, int n,
                  const double* t, MemoryWork<Task>& w, MemoryAnswer<Task>& answer) {
  using R = typename Task::Robot;
  constexpr int nq = R::nq, nv = R::nv;
  static_assert(R::nu == nv, "the controls of a guess are its inverse dynamics");
  answer.n = answer.refused = 0;
  answer.status = kTabOk;
  answer.distance = INFINITY;
  answer.deviation = 1;
  if (!memory::finite(x0, nq + nv) || !memory::finite(t, n + 1) || !memory::finite(goal.p, 3) || !memory::finite(goal.R, 9)) {
    answer.status = kTabNotFinite;
    return;
  }
  const int slots = memory::look_up(tables, opts, goal, x0, w, answer);
  memory::find_ends(goal, slots, w);
  for (int s = 0; s < slots; ++s) {
    // the guess at position n takes slot s, and w.slot[n] keeps it for the next step
    if (memory::judge(tables, opts, answer.deviation, w.slot[s], answer.guess[answer.n])) {
      w.slot[answer.n++] = w.slot[s];
    } else {
      ++answer.refused;
    }
  }
  tab_rbf_basis(tables.time, n + 1, t, w.basis, nullptr);
  const double T = tables.time->head.array[1].data[0];
  for (int first = 0; first < answer.n; first += kLanes) {
    const int lanes = answer.n - first < kLanes ? answer.n - first : kLanes;
    Pack end[nq];
    for (int l = 0; l < kLanes; ++l) {  // beyond the last guess: copies of the first
      const auto& slot = w.slot[first + (l < lanes ? l : 0)];
      memory::decode_bow<Task>(tables, slot, n, l, w);
      for (int i = 0; i < nq; ++i) end[i].l[l] = slot.end[i];
    }
    warp_bow<R>(x0, end, n, t, T, w.path);
    follow_path<R>(x0 + nq, n, t, w.path, w.rbd, [&](int k, const Pack* q, const Pack* v, const Pack* u) {
      for (int l = 0; l < lanes; ++l) {
        Guess<Task>& guess = answer.guess[first + l];
        for (int i = 0; i < nq; ++i) guess.x[k][i] = q[i].l[l];
        for (int i = 0; i < nv; ++i) guess.x[k][nq + i] = v[i].l[l];
        for (int i = 0; u != nullptr && i < nv; ++i) guess.u[k][i] = u[i].l[l];
      }
    });
    for (int l = 0; l < lanes; ++l) {
      for (int i = 0; i < nq + nv; ++i) answer.guess[first + l].x[0][i] = x0[i];  // to the last bit
    }
  }
}

}  // namespace engram
#endif  // CONTROLLER_MEMORY_MEMORY_QUERY_H_
