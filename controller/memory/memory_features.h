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

// Most outputs of the k-NN and GPR tables: end posture and coefficients of the bow
inline constexpr int kMemoryMaxOutputs = 96;

// Inputs of the trust table: distance of the sample, deviation of the regression, warp at the goal [rad], is it a regression, a line
inline constexpr int kMemoryTrustInputs = 5;

inline void memory_trust_inputs(double distance, double deviation, double warp, GuessKind kind, double* x) {
  x[0] = distance;
  x[1] = deviation;
  x[2] = warp;
  x[3] = kind == GuessKind::kRegression;
  x[4] = kind == GuessKind::kLine;
}

}  // namespace engram
#endif  // CONTROLLER_MEMORY_MEMORY_FEATURES_H_
