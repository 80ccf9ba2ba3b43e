// One query of the memory: look up, correct the ends, find lines and regressions, decode, bend, make it a motion.
#ifndef CONTROLLER_MEMORY_MEMORY_QUERY_H_
#define CONTROLLER_MEMORY_MEMORY_QUERY_H_

#include "controller/ik/ik_pose.h"
#include "controller/memory/memory_features.h"
#include "controller/memory/memory_train.h"
#include "controller/memory/memory_warp.h"
#include "controller/tab/tab_random.h"

#include <cmath>

namespace engram {

template <class Task> struct MemoryWork {
  using R = typename Task::Robot;
  static constexpr int N = Task::nknots, nq = R::nq;
  static constexpr int kSlots = kMemoryGuesses + kLanes;  // and what is tried beside
  // A guess in the making.
  struct Slot {
    GuessKind kind;
    int32_t source;
    const float* bow;   // its coefficients (m); null: no bow
    double distance;    // of the (nearest) sample [-]
    double deviation;   // of the regression; 0 for others
    double start[nq];   // where inverse kinematics starts
    double end[nq];     // where it ends
    bool reached;       // within kMemoryIkTolerance of the goal
    double trust_inputs[kMemoryTrustInputs];
  };
  Slot slot[kSlots];
  double features[kMemoryFeatures<Task>], bow_features[kMemoryBowFeatures<Task>];
  int32_t index[kMemoryPool];
  float distance2[kMemoryPool];
  alignas(64) float mode[kMemoryModes * (nq + kMemoryMaxBow + TAB_LANES)];  // answers of a learner
  float mode_bow[kMemoryLearners][kMemoryModes][kMemoryMaxBow];
  alignas(64) float regression[kMemoryTrains + kMemoryLines][kMemoryMaxBow + TAB_LANES];
  double posture[kMemoryTrains][nq];  // of the train
  alignas(64) float weights[TAB_RBF_MAX_K * (nq + R::nu) + TAB_LANES];  // of a bow and its controls over time
  double basis[(N + 1) * TAB_RBF_MAX_K];
  double bow[N + 1][nq];
  Pack path[N + 1][nq];  // kLanes guesses side by side
  RbdData<R, Pack> rbd;
  MemoryTrain<Task> train;
};

template <class Task> void memory_init(const MemoryTables& tables, MemoryWork<Task>& w) {
  MemoryTrain<Task>& train = w.train;
  train.ready = tables.train != nullptr &&
                tab_tt_init(&train.sampler, tables.train, kMemoryTrainSamples, train.bytes, sizeof train.bytes) == kTabOk;
}

inline constexpr double kMemoryIkTolerance = 1e-3;  // [m, rad] an end farther from the goal counts as not reached
inline constexpr int kMemoryWarpIterations = 10;     // of inverse kinematics from a remembered end, which is near
inline constexpr double kMemoryFar = 1e3;           // distance that stands for "no sample at all"
inline constexpr double kMemoryHuge = 1e6;          // no state, goal or time is that large

// The steps of memory_query.
namespace memory {

// Adds what has passed since the last call to a kind's account.
class Laps {
 public:
  Laps(double (*clock)(), double* us) : clock_(clock), us_(us), last_(now()) {}
  void add(GuessKind kind) {
    const double t = now();
    us_[int(kind)] += t - last_;
    last_ = t;
  }
  // The same shared out among all guesses.
  template <class Task> void share(const MemoryAnswer<Task>& answer) {
    const double each = answer.n > 0 ? (now() - last_) / answer.n : 0.0;
    for (int i = 0; i < answer.n; ++i) us_[int(answer.guess[i].kind)] += each;
  }

 private:
  double now() const { return clock_ != nullptr ? clock_() : 0.0; }
  double (*clock_)();
  double* us_;
  double last_;
};

inline GuessKind kind_of(const TabHead& learner) { return learner.kind == kTabMlp ? GuessKind::kNetwork : GuessKind::kMixture; }

inline bool usable(const double* x, int n) {
  for (int i = 0; i < n; ++i) {
    if (!(std::fabs(x[i]) < kMemoryHuge)) return false;
  }
  return true;
}

// The next slot.
template <class Task>
typename MemoryWork<Task>::Slot& add(MemoryWork<Task>& w, int& slots, GuessKind kind, int source, const float* bow, double distance) {
  auto& slot = w.slot[slots++];
  slot.kind = kind;
  slot.source = source;
  slot.bow = bow;
  slot.distance = distance;
  slot.deviation = 0;
  return slot;
}

// Inverse kinematics from the start of the slots [first, end), kLanes at a time -> end, reached.
template <class Task> void find_ends(const ReachTarget& goal, int iterations, int first, int end, MemoryWork<Task>& w) {
  using R = typename Task::Robot;
  for (; first < end; first += kLanes) {
    Pack q[R::nq];
    for (int l = 0; l < kLanes; ++l) {
      const auto& slot = w.slot[first + l < end ? first + l : first];
      for (int i = 0; i < R::nq; ++i) q[i].l[l] = slot.start[i];
    }
    const Pack error = ik_pose<R, Task::frame>(goal, q, w.rbd, iterations);
    for (int l = 0; l < kLanes && first + l < end; ++l) {
      auto& slot = w.slot[first + l];
      for (int i = 0; i < R::nq; ++i) slot.end[i] = q[i].l[l];
      slot.reached = error.l[l] < kMemoryIkTolerance;
    }
  }
}

template <class Task> double warp_of(const typename MemoryWork<Task>::Slot& slot) {
  double warp = 0;
  for (int i = 0; i < Task::Robot::nq; ++i) warp = std::fmax(warp, std::fabs(slot.end[i] - slot.start[i]));
  return warp;
}

// Of the slots [kept, last): those whose end could be corrected move to the front, up to `most` in all; returns how many there are.
template <class Task>
int keep_corrected(const MemoryOpts& opts, int kept, int last, int most, MemoryWork<Task>& w, MemoryAnswer<Task>& answer) {
  for (int i = kept; i < last && kept < most; ++i) {
    if (w.slot[i].reached && warp_of<Task>(w.slot[i]) <= opts.max_warp) w.slot[kept++] = w.slot[i];
    else ++answer.refused;
  }
  return kept;
}

// The nearest samples whose end can be corrected -> the first slots; returns how many.
template <class Task>
int find_neighbours(const MemoryTables& tables, const MemoryOpts& opts, const ReachTarget& goal, MemoryWork<Task>& w,
                    MemoryAnswer<Task>& answer) {
  constexpr int nq = Task::Robot::nq;
  if (opts.neighbours == 0) return 0;
  answer.status = tab_knn_query(tables.knn, w.features, kMemoryPool, w.index, w.distance2);
  answer.distance = std::sqrt(w.distance2[0]);
  int kept = 0;
  for (int first = 0; first < kMemoryPool && kept < opts.neighbours; first += kLanes) {
    // the next kLanes samples sit behind those that are kept
    int last = kept;
    for (int i = first; i < first + kLanes && i < kMemoryPool && w.index[i] >= 0; ++i) {
      const float* const value = tab_knn_value(tables.knn, w.index[i]);
      auto& slot = add(w, last, GuessKind::kNeighbour, w.index[i], value + nq, std::sqrt(w.distance2[i]));
      for (int j = 0; j < nq; ++j) slot.start[j] = value[j];
    }
    find_ends(goal, kMemoryWarpIterations, kept, last, w);
    kept = keep_corrected(opts, kept, last, opts.neighbours, w, answer);
  }
  return kept;
}

// The likeliest modes of one learner whose end can be corrected -> further slots; returns how many slots there are. bows: room for
// those of its modes.
template <class Task>
int find_modes(const MemoryTables& tables, const TabHead& learner, const MemoryOpts& opts, const ReachTarget& goal, int slots,
               float (*bows)[kMemoryMaxBow], MemoryWork<Task>& w, MemoryAnswer<Task>& answer) {
  constexpr int nq = Task::Robot::nq;
  if (opts.modes == 0) return slots;
  int32_t index[kMemoryModes];
  float probability[kMemoryModes];
  const TabStatus status = tab_answers(&learner, w.features, opts.modes, index, probability, w.mode, nullptr);
  answer.status = tab_worse(answer.status, status);
  const int leading = learner.nout - nq;
  int last = slots;
  for (int i = 0; i < opts.modes && index[i] >= 0; ++i) {
    const float* const y = w.mode + i * tab_pad(learner.nout);
    for (int j = 0; j < tables.bow->m; ++j) bows[i][j] = j < leading ? y[nq + j] : 0.0f;  // zeros for the coefficients it lacks
    auto& slot = add(w, last, kind_of(learner), index[i], bows[i], answer.distance);
    for (int j = 0; j < nq; ++j) slot.start[j] = y[j];
  }
  find_ends(goal, kMemoryWarpIterations, slots, last, w);
  return keep_corrected(opts, slots, last, last, w, answer);
}

// The bow that the process predicts for the end of a slot -> bow (pad(m)), deviation
template <class Task>
void regress(const MemoryTables& tables, const ReachTarget& goal, const double* x0, typename MemoryWork<Task>::Slot& slot, float* bow,
             MemoryWork<Task>& w, MemoryAnswer<Task>& answer) {
  memory_bow_features<Task>(x0, slot.end, goal, w.bow_features);
  float variance;
  tab_gpr_query(tables.gpr, w.bow_features, bow, &variance);
  slot.bow = bow;
  slot.deviation = std::sqrt(variance / (tables.gpr->variance + tables.gpr->noise));
  answer.deviation = std::fmin(answer.deviation, slot.deviation);
}

// Postures of the train that can be corrected for the goal -> further slots; returns how many slots there are.
template <class Task>
int find_trains(const MemoryTables& tables, const MemoryOpts& opts, const ReachTarget& goal, const double* x0, int slots,
                MemoryWork<Task>& w, MemoryAnswer<Task>& answer) {
  constexpr int nq = Task::Robot::nq;
  if (!w.train.ready || opts.trains == 0) return slots;
  TabStatus status;
  const int n = likely_postures<Task>(goal, uint64_t(opts.elsewhere + 1), opts.trains, w.train, status, w.posture);
  answer.status = tab_worse(answer.status, status);
  int last = slots;
  for (int i = 0; i < n; ++i) {
    auto& slot = add(w, last, GuessKind::kTrain, i, nullptr, answer.distance);
    for (int j = 0; j < nq; ++j) slot.start[j] = w.posture[i][j];
  }
  find_ends(goal, kMemoryWarpIterations, slots, last, w);
  last = keep_corrected(opts, slots, last, last, w, answer);
  for (int i = slots; i < last; ++i) regress(tables, goal, x0, w.slot[i], w.regression[i - slots], w, answer);
  return last;
}

// Lines and their regressions -> further slots; returns how many slots there are.
template <class Task>
int find_lines(const MemoryTables& tables, const MemoryOpts& opts, const ReachTarget& goal, const double* x0, int slots, Laps& laps,
               MemoryWork<Task>& w, MemoryAnswer<Task>& answer) {
  using R = typename Task::Robot;
  const int first = slots;
  for (int source = slots > 0 ? 0 : 1; source < opts.lines; ++source) {
    const double* const start = source == 0 ? w.slot[0].end : source == 1 ? R::q_home : x0;
    auto& slot = add(w, slots, GuessKind::kLine, source, nullptr, answer.distance);
    const bool drawn = source == 2 && opts.elsewhere != 0;
    for (int i = 0; i < R::nq; ++i) {
      slot.start[i] = drawn ? R::q_lo[i] + (R::q_hi[i] - R::q_lo[i]) * tab_random_uniform(Task::digest, opts.elsewhere, i) : start[i];
    }
  }
  const int last = slots;
  find_ends(goal, IkOptions{}.iterations, first, last, w);
  laps.add(GuessKind::kLine);
  for (int i = first; i < last && opts.regression; ++i) {
    if (!w.slot[i].reached) continue;
    auto& slot = w.slot[slots++];
    slot = w.slot[i];
    slot.kind = GuessKind::kRegression;
    regress(tables, goal, x0, slot, w.regression[kMemoryTrains + i - first], w, answer);
  }
  return slots;
}

// Kind, warp and trust of a slot -> guess
template <class Task>
void judge(const MemoryTables& tables, typename MemoryWork<Task>::Slot& slot, Guess<Task>& guess) {
  guess.kind = slot.kind;
  guess.source = slot.source;
  guess.warp = warp_of<Task>(slot);
  memory_trust_inputs(std::fmin(slot.distance, kMemoryFar), slot.deviation, guess.warp, slot.kind, slot.trust_inputs);
  guess.trust = 0;
  if (slot.reached) tab_logit_eval(tables.trust, slot.trust_inputs, &guess.trust);
}

// The bow of a slot at the knots -> lane l of w.path; the weights of its controls stay in w.weights
template <class Task>
void decode_bow(const MemoryTables& tables, const typename MemoryWork<Task>::Slot& slot, int n, int l, MemoryWork<Task>& w) {
  constexpr int nq = Task::Robot::nq;
  if (slot.bow == nullptr) {
    for (int k = 0; k <= n; ++k)
      for (int i = 0; i < nq; ++i) w.path[k][i].l[l] = 0;
    return;
  }
  tab_pca_decode(tables.bow, slot.bow, w.weights);
  tab_rbf_eval(tables.time, w.weights, 0, nq, n + 1, w.basis, w.bow[0]);
  for (int k = 0; k <= n; ++k)
    for (int i = 0; i < nq; ++i) w.path[k][i].l[l] = w.bow[k][i];
}

// What is added to the inverse dynamics of a slot, whose bow was decoded last -> guess.u
template <class Task>
void decode_controls(const MemoryTables& tables, const MemoryOpts& opts, const typename MemoryWork<Task>::Slot& slot, int n,
                     const MemoryWork<Task>& w, Guess<Task>& guess) {
  using R = typename Task::Robot;
  if (opts.recall_controls && slot.bow != nullptr) {
    tab_rbf_eval(tables.time, w.weights, R::nq, R::nu, n, w.basis, guess.u[0]);
    return;
  }
  for (int k = 0; k < n; ++k)
    for (double& u : guess.u[k]) u = 0;
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
  for (double& us : answer.us) us = 0;
  if (!memory::usable(x0, nq + nv) || !memory::usable(t, n + 1) || !memory::usable(goal.p, 3) || !memory::usable(goal.R, 9)) {
    answer.status = kTabNotFinite;
    return;
  }
  memory::Laps laps(opts.clock, answer.us);
  memory_features<Task>(x0, goal, w.features);
  const int neighbours = memory::find_neighbours(tables, opts, goal, w, answer);
  laps.add(GuessKind::kNeighbour);
  int remembered = neighbours;
  for (int i = 0; i < kMemoryLearners && tables.learner[i] != nullptr; ++i) {
    remembered = memory::find_modes(tables, *tables.learner[i], opts, goal, remembered, w.mode_bow[i], w, answer);
    laps.add(memory::kind_of(*tables.learner[i]));
  }
  const int sampled = memory::find_trains(tables, opts, goal, x0, remembered, w, answer);
  laps.add(GuessKind::kTrain);
  answer.n = memory::find_lines(tables, opts, goal, x0, sampled, laps, w, answer);
  laps.add(GuessKind::kRegression);
  for (int i = 0; i < answer.n; ++i) memory::judge<Task>(tables, w.slot[i], answer.guess[i]);
  tab_rbf_basis(tables.time, n + 1, t, w.basis, nullptr);
  const double T = tab_hi(&tables.time->head)[0];
  for (int first = 0; first < answer.n; first += kLanes) {
    const int lanes = answer.n - first < kLanes ? answer.n - first : kLanes;
    Pack end[nq];
    for (int l = 0; l < kLanes; ++l) {  // beyond the last guess: copies of the first
      const auto& slot = w.slot[first + (l < lanes ? l : 0)];
      memory::decode_bow<Task>(tables, slot, n, l, w);
      if (l < lanes) memory::decode_controls<Task>(tables, opts, slot, n, w, answer.guess[first + l]);
      for (int i = 0; i < nq; ++i) end[i].l[l] = slot.end[i];
    }
    warp_bow<R>(x0, end, n, t, T, w.path);
    follow_path<R>(x0 + nq, n, t, w.path, w.rbd, [&](int k, const Pack* q, const Pack* v, const Pack* u) {
      for (int l = 0; l < lanes; ++l) {
        Guess<Task>& guess = answer.guess[first + l];
        for (int i = 0; i < nq; ++i) guess.x[k][i] = q[i].l[l];
        for (int i = 0; i < nv; ++i) guess.x[k][nq + i] = v[i].l[l];
        for (int i = 0; u != nullptr && i < nv; ++i) guess.u[k][i] += u[i].l[l];
      }
    });
  }
  laps.share(answer);
}

}  // namespace engram
#endif  // CONTROLLER_MEMORY_MEMORY_QUERY_H_
