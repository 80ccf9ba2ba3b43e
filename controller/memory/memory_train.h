// Ends for motions from a tensor train over goals and postures: samples given the goal, the best few of them by cost that differ.
// Source: thesis, sections 7.3 and 7.5; algorithm 6.
#ifndef CONTROLLER_MEMORY_MEMORY_TRAIN_H_
#define CONTROLLER_MEMORY_MEMORY_TRAIN_H_

#include "controller/memory/memory_pose.h"
#include "controller/tab/tab_tt.h"

#include <cmath>

namespace engram {

inline constexpr int kMemoryTrainSamples = 64;
inline constexpr double kMemoryTrainPriority = 0.8;  // alpha of algorithm 6
inline constexpr double kMemoryTrainApart = 0.3;     // [rad] postures that differ less in every joint are one
inline constexpr int64_t kMemoryTrainBytes = 96 * 1024;  // room for the sampler

// A sampler and all its memory. Not copied: the sampler points into it.
template <class Task> struct MemoryTrain {
  static constexpr int nq = Task::Robot::nq, d = kMemoryPose + nq;
  alignas(64) unsigned char bytes[kMemoryTrainBytes];
  TabTtSampler sampler;
  bool ready = false;  // memory_init has been here
  double x[kMemoryTrainSamples][d];
  double cost[kMemoryTrainSamples];
  int32_t order[kMemoryTrainSamples];

  MemoryTrain() = default;
  MemoryTrain(const MemoryTrain&) = delete;
  MemoryTrain& operator=(const MemoryTrain&) = delete;
};

namespace memory {

// (|p_WF - p_WT| / 0.05 + (3 - tr(R_WT' R_WF)) / 4 / 0.2 + max(0, 0.02 - clearance) / 0.01) / 3 at q (nq): as the train's density
// weighs them (codegen/offline/study_pose.h), but of the spheres the nearest alone counts, linearly.
template <class Task, class S> S posture_cost(const ReachTarget& goal, const S* q) {
  Mat3<S> R_WF;
  Vec3<S> p_WF;
  reach_hand<Task, S>(q, R_WF, p_WF);
  const Vec3<S> off = p_WF - constant3<S>(goal.p);
  S trace = 0.0;
  for (int i = 0; i < 9; ++i) trace += S(goal.R[i]) * R_WF(i / 3, i % 3);
  const S near = max(S(0.0), S(0.02) - reach_clearance<Task, S>(q));
  return (sqrt(dot(off, off)) * (1 / 0.05) + (3.0 - trace) * (0.25 / 0.2) + near * (1 / 0.01)) * (1.0 / 3);
}

// Up to `most` postures (most, nq) of low cost for the goal, the lowest first, which differ from each other; returns how many.
// status: of conditioning on the goal. Work: one call of tab_tt_sample, kMemoryTrainSamples forward kinematics.
template <class Task>
int likely_postures(const ReachTarget& goal, uint64_t seed, int most, MemoryTrain<Task>& w, TabStatus& status,
                    double (*posture)[Task::Robot::nq]) {
  constexpr int nq = Task::Robot::nq, d = kMemoryPose + nq, n = kMemoryTrainSamples;
  double given[d] = {};
  bool fixed[d] = {};
  memory_pose(goal, given);
  for (int i = 0; i < kMemoryPose; ++i) fixed[i] = true;
  status = tab_tt_condition(&w.sampler, given, fixed);
  if (status >= kTabNotFinite || tab_tt_sample(&w.sampler, kMemoryTrainPriority, n, seed, w.x[0], nullptr) >= kTabNotFinite) return 0;
  for (int first = 0; first < n; first += kLanes) {
    Pack q[nq];
    for (int l = 0; l < kLanes; ++l)
      for (int i = 0; i < nq; ++i) q[i].l[l] = w.x[first + l][kMemoryPose + i];
    const Pack cost = posture_cost<Task, Pack>(goal, q);
    for (int l = 0; l < kLanes; ++l) w.cost[first + l] = cost.l[l];
  }
  static_assert(n % kLanes == 0, "whole lanes");
  tab_lowest(w.cost, n, n, w.order);
  int kept = 0;
  for (int s = 0; s < n && kept < most && w.order[s] >= 0; ++s) {
    const double* const q = w.x[w.order[s]] + kMemoryPose;
    bool other = true;
    for (int j = 0; j < kept && other; ++j) {
      double apart = 0;
      for (int i = 0; i < nq; ++i) apart = std::fmax(apart, std::fabs(q[i] - posture[j][i]));
      other = apart > kMemoryTrainApart;
    }
    if (!other) continue;
    for (int i = 0; i < nq; ++i) posture[kept][i] = q[i];
    ++kept;
  }
  return kept;
}

}  // namespace memory
}  // namespace engram
#endif  // CONTROLLER_MEMORY_MEMORY_TRAIN_H_
