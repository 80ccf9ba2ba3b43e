// What the tables are asked with: the features of a query and of a guess. Weights of the features live in the tables.
#ifndef CONTROLLER_MEMORY_MEMORY_FEATURES_H_
#define CONTROLLER_MEMORY_MEMORY_FEATURES_H_

#include "controller/memory/memory.h"

namespace engram {

// q (nq), target position p_WT (3) [m], target axes z and x in the world (3 + 3) [-]
template <class Task> inline constexpr int kMemoryFeatures = Task::Robot::nq + 9;

template <class Task> void memory_features(const double* q, const ReachTarget& goal, double* x) {
  constexpr int nq = Task::Robot::nq;
  for (int i = 0; i < nq; ++i) x[i] = q[i];
  for (int i = 0; i < 3; ++i) {
    x[nq + i] = goal.p[i];
    x[nq + 3 + i] = goal.R[3 * i + 2];
    x[nq + 6 + i] = goal.R[3 * i];
  }
}

// start q (nq), end q (nq), target position p_WT (3) [m]
template <class Task> inline constexpr int kMemoryBowFeatures = 2 * Task::Robot::nq + 3;

template <class Task> void memory_bow_features(const double* start, const double* end, const ReachTarget& goal, double* x) {
  constexpr int nq = Task::Robot::nq;
  for (int i = 0; i < nq; ++i) {
    x[i] = start[i];
    x[nq + i] = end[i];
  }
  for (int i = 0; i < 3; ++i) x[2 * nq + i] = goal.p[i];
}

inline constexpr int kMemoryMaxBow = TAB_MAX_IN;  // most coefficients of a bow

// Inputs of the trust table: distance of the (nearest) sample, deviation of the regression (0 for others), warp [rad], is it a
// regression, is it a line, is it of a mixture, of the train, of a network
inline constexpr int kMemoryTrustInputs = 8;

inline void memory_trust_inputs(double distance, double deviation, double warp, GuessKind kind, double* x) {
  x[0] = distance;
  x[1] = deviation;
  x[2] = warp;
  x[3] = kind == GuessKind::kRegression;
  x[4] = kind == GuessKind::kLine;
  x[5] = kind == GuessKind::kMixture;
  x[6] = kind == GuessKind::kTrain;
  x[7] = kind == GuessKind::kNetwork;
}

}  // namespace engram
#endif  // CONTROLLER_MEMORY_MEMORY_FEATURES_H_
