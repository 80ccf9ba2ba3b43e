// One query of the memory, in five steps: look up, decode, find goal postures, bend, make it a motion.
//
// Cost on a 7-joint arm, 14 guesses, 50 knots: n d multiply-adds of the k-NN, n^2/2 of the regression's variance, 11 decodings of
// m k (nq + nu) each, 4 packs of inverse kinematics and 4 x 50 packs of inverse dynamics.
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
  static constexpr int kSlots = kMemoryGuesses;

  // look up
  double features[kMemoryFeatures<Task>];
  int32_t index[kMemoryNeighbours];
  float distance2[kMemoryNeighbours];
  alignas(64) float code[TAB_MAX_IN];                               // of the regression
  // decode: row 0 .. n at the knots, row n + 1 at the memory's end; first knot's slope
  double basis[(N + 2) * TAB_RBF_MAX_K], basis_slope[TAB_RBF_MAX_K], basis_start[TAB_RBF_MAX_K];
  alignas(64) float weights[TAB_RBF_MAX_K * (R::nq + R::nu) + TAB_LANES];
  // one slot per possible guess
  struct Slot {
    GuessKind kind;
    int32_t source;
    double distance;
    double path[N + 2][R::nq];  // remembered q at the knots and at the memory's end
    double start_v[R::nq];      // its velocity at the first knot
    double goal_q[R::nq];       // what its end is to become
  } slot[kSlots];
  int32_t used[kSlots + kLanes];  // slots that were not refused
  // kLanes motions side by side
  Pack q[N + 1][R::nq];
  RbdData<R, Pack> rbd;
};

// Details of memory_query, in its order.
namespace memory {

// Remembered motion with PCA coefficients `code` -> slot.path, slot.start_v
template <class Task> void decode(const MemoryTables& tables, const float* code, int n, MemoryWork<Task>& w, typename MemoryWork<Task>::Slot& slot) {
  constexpr int nq = Task::Robot::nq;
  tab_pca_decode(tables.pca, code, w.weights);
  tab_rbf_eval(tables.rbf, w.weights, 0, nq, n + 2, w.basis, slot.path[0]);
  tab_rbf_eval(tables.rbf, w.weights, 0, nq, 1, w.basis_slope, slot.start_v);
}

// A path that stands still at q: warped, it becomes a straight line.
template <class Task> void stand_still(const double* q, int n, typename MemoryWork<Task>::Slot& slot) {
  for (int i = 0; i < Task::Robot::nq; ++i) {
    for (int k = 0; k < n + 2; ++k) slot.path[k][i] = q[i];
    slot.start_v[i] = 0;
  }
}

}  // namespace memory
