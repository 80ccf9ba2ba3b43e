// The memory of steps: where both feet stand and where one of them goes in, a guess of the optimal step (xs, us) out.
//
//   StepTask     one step, poses of feet in any one frame of the ground: alone, or within a walk (from_walk, into_walk)
//   step_query   its knots step_first .. step_last, or from a later one on; asked when a step enters the horizon, from the plan's last state
//
//   feet, goal -> six numbers: start and goal of the foot that swings, in the axes of the one that stands, mirrored if it is the right one
//              -> z by regression, one for each foot -> dq(t) = q(t) (-) q(0), u(t) by PCA, one for both feet
//              -> q = q0 (+) dq,  v_{k+1} = (q_{k+1} (-) q_k) / dt as the integrator has it: gaps are left in v alone
//
// The robot's two sides are alike but for some grams, so that the bases are shared and the regressions are not (docs/steps.md).
// No heap, no exceptions, no I/O; operations: the regression's n (6 + m) + n^2 / 2, then m times the numbers of a step (2660).
#ifndef CONTROLLER_MEMORY_STEP_MEMORY_H_
#define CONTROLLER_MEMORY_STEP_MEMORY_H_

#include "controller/rbd/rbd_manifold.h"
#include "controller/tab/tab_gpr.h"
#include "controller/tab/tab_pca.h"

#include <cmath>
#include <cstring>

namespace engram {

struct StepTables {
  const TabGpr* regression[2];  // of the left and of the right foot: features (6) -> coefficients (of the path, then of the torques)
  const TabPca* path;           // -> dq at knots 1 .. N (N, nv) of the left foot's steps
  const TabPca* torque;         // -> u (N, nu)
};

inline constexpr int kStepFeatures = 6, kStepMaxCoefficients = 192;

inline constexpr int kStepBetween = 4;  // knots on both feet between two swings of a walk; a step has half of them at either end

// A step. Poses (x, y, yaw) [m, rad] in any one frame of the ground.
struct StepTask {
  double feet[2][3];            // left and right at its beginning
  double goal[3];               // where `foot` goes
  int foot = 0;                 // that swings: 0 left, 1 right
  bool from_walk = false;       // another step came before; or the robot is at rest
  bool into_walk = false;       // another step comes after; or the robot comes to rest
  double previous[3] = {};      // from_walk: where the foot that stands now stood before it swung
  double next[3] = {};          // into_walk: where the foot that stands now goes in the step after
};

// The first knot of a step, and the last, where the one after begins: of Task::nknots from rest to rest, those about its swing in a walk.
template <class Task> constexpr int step_first(const StepTask& t) {
  return t.from_walk ? static_cast<int>(Task::gait_before) - kStepBetween / 2 : 0;
}
template <class Task> constexpr int step_last(const StepTask& t) {
  return t.into_walk ? static_cast<int>(Task::gait_before + Task::gait_swing) + kStepBetween / 2 : Task::nknots;
}

// Task: tables/<robot>_<task>/task.h; Mirror: which driven dof takes which other one's place, and its sign, seen in a mirror.
template <class Task> struct StepGuess {
  using R = typename Task::Robot;
  static constexpr int N = Task::nknots;
  double x[N + 1][R::nq + R::nv];  // x[first] is the state that was given
  double u[N][R::nu];
  int first, last;    // knots of x that are filled; of u all but the last
  TabStatus status;   // kTabOutside: the task lies outside what was learnt
  double deviation;   // of the regression, relative to its prior: 0 (known) .. 1 (unknown)
};

template <class Task> struct StepWork {
  using R = typename Task::Robot;
  alignas(64) float z[kStepMaxCoefficients + TAB_LANES], z_torque[kStepMaxCoefficients + TAB_LANES];
  alignas(64) float path[Task::nknots * R::nv + TAB_LANES], torque[Task::nknots * R::nu + TAB_LANES];
};

// Talos: legs, torso, arms with grippers, head. Rolls and yaws change their sign, pitches and grippers do not.
struct TalosMirror {
  static constexpr int nu = 32;
  static constexpr int other[nu] = {6,  7,  8,  9,  10, 11, 0,  1,  2,  3,  4,  5,  12, 13, 22, 23,
                                    24, 25, 26, 27, 28, 29, 14, 15, 16, 17, 18, 19, 20, 21, 30, 31};
  static constexpr double sign[nu] = {-1, -1, 1,  1, 1,  -1, -1, -1, 1,  1,  1, -1, -1, 1, -1, -1,
                                      -1, 1,  -1, -1, 1, 1,  -1, -1, -1, 1, -1, -1, 1,  1, 1,  -1};
  static constexpr double base[6] = {1, -1, 1, -1, 1, -1};  // dq of the base, body axes
};

// Do the tables belong to this robot and task, are they whole, and do their sizes fit together? text: TAB_TEXT bytes. Init only.
template <class Task> TabStatus step_check(const StepTables& tables, char* text) {
  using R = typename Task::Robot;
  const auto checked = [&](const TabHead* head, TabKind kind) { return tab_check(head, kind, R::digest, Task::digest, text) == kTabOk; };
  for (const TabGpr* regression : tables.regression)
    if (!checked(regression ? &regression->head : nullptr, kTabGpr)) return kTabBad;
  if (!checked(tables.path ? &tables.path->head : nullptr, kTabPca)) return kTabBad;
  if (!checked(tables.torque ? &tables.torque->head : nullptr, kTabPca)) return kTabBad;
  bool fit = tables.path->n == Task::nknots * R::nv && tables.torque->n == Task::nknots * R::nu;
  for (const TabGpr* regression : tables.regression)
    fit = fit && regression->d == kStepFeatures && regression->m == tables.path->m + tables.torque->m && regression->m <= kStepMaxCoefficients;
  if (fit) return kTabOk;
  constexpr char kMisfit[] = "the tables of steps do not fit each other; run 'engram fit talos step' and build again";
  static_assert(sizeof kMisfit <= TAB_TEXT, "fits the caller's buffer");
  std::memcpy(text, kMisfit, sizeof kMisfit);
  return kTabBad;
}

inline void step_features(const StepTask& t, double (&x)[kStepFeatures]) {
  const double* const stands = t.feet[1 - t.foot];
  const double c = std::cos(stands[2]), s = std::sin(stands[2]), mirror = t.foot == 0 ? 1.0 : -1.0;
  const double* const seen[2] = {t.feet[t.foot], t.goal};
  for (int i = 0; i < 2; ++i) {
    const double dx = seen[i][0] - stands[0], dy = seen[i][1] - stands[1];
    x[3 * i] = c * dx + s * dy;
    x[3 * i + 1] = mirror * (-s * dx + c * dy);
    x[3 * i + 2] = mirror * (seen[i][2] - stands[2]);
  }
}

// The guess from knot `at` of the step on, where the robot has the state x0 (nq + nv): measured, or the last of the plan that is continued.
// False if a number is not finite or `at` is no knot of the step before its last: no guess.
template <class Task, class Mirror>
bool step_query(const StepTables& tables, const StepTask& task, int at, const double* x0, StepWork<Task>& w, StepGuess<Task>& guess) {
  using R = typename Task::Robot;
  constexpr int nq = R::nq, nv = R::nv, nu = R::nu, base = nv - nu;
  static_assert(base == 6 && Mirror::nu == nu, "a free base and driven joints");
  guess.first = at;
  guess.last = step_last<Task>(task);
  if (at < step_first<Task>(task) || at >= guess.last) return false;
  double features[kStepFeatures];
  step_features(task, features);
  for (int i = 0; i < nq + nv; ++i)
    if (!std::isfinite(x0[i])) return false;
  float variance;
  const int foot = task.foot;
  const TabGpr& regression = *tables.regression[foot];
  guess.status = tab_gpr_query(&regression, features, w.z, &variance);
  if (guess.status == kTabNotFinite) return false;
  if (task.from_walk || task.into_walk) guess.status = kTabOutside;  // the tables know steps from rest to rest
  guess.deviation = std::sqrt(variance / (regression.variance + regression.noise));
  tab_pca_decode(tables.path, w.z, w.path);
  tab_pca_decode(tables.torque, w.z + tables.path->m, w.torque);

  std::memcpy(guess.x[at], x0, sizeof(guess.x[at]));
  for (int k = at; k < guess.last; ++k) {
    const float* const dq = w.path + k * nv;
    const float* const start = w.path + (at - 1) * nv;
    const float* const u = w.torque + k * nu;
    const auto moved_by = [&](int i) { return at > 0 ? dq[i] - start[i] : dq[i]; };
    double step[nv], moved[nv];
    for (int i = 0; i < base; ++i) step[i] = foot == 0 ? moved_by(i) : Mirror::base[i] * moved_by(i);
    for (int i = 0; i < nu; ++i) {
      step[base + i] = foot == 0 ? moved_by(base + i) : Mirror::sign[i] * moved_by(base + Mirror::other[i]);
      guess.u[k][i] = foot == 0 ? u[i] : Mirror::sign[i] * u[Mirror::other[i]];
    }
    rbd_integrate<R>(x0, step, guess.x[k + 1]);
    rbd_difference<R>(guess.x[k], guess.x[k + 1], moved);
    for (int i = 0; i < nv; ++i) guess.x[k + 1][nq + i] = moved[i] / Task::dt;
  }
  return true;
}

}  // namespace engram
#endif  // CONTROLLER_MEMORY_STEP_MEMORY_H_
