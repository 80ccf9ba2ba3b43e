// The memory of steps: where both feet stand and where one of them goes in, a guess of the optimal step (xs, us) out.
//
//   StepTask     one step, poses of feet in any one frame of the ground: alone, or within a walk (from_walk, into_walk)
//   step_query   its knots step_first .. step_last, or from a later one on; asked when a step enters the horizon, from its last state
//
//   feet, goal -> where the foot that swings starts and goes, in the axes of the one that stands; of a walk also where that one was and
//                 goes next; mirrored if it is the right one
//              -> z by regression -> dq(t) = q(t) (-) q_level, u(t) by PCA
//              -> q = q_level (+) dq,  v_{k+1} = (q_{k+1} (-) q_k) / dt as the integrator has it: gaps are left in v alone
//
// q_level is home, between the feet and turned as they are: every step has its own frame, and a walk drifts no farther than its feet. Where
// the robot is not quite where the memory has it, the difference fades within kStepFade knots.
// No heap, no exceptions, no I/O; operations: the regression's n (15 + m), then m times the numbers of a step (2698).
#ifndef CONTROLLER_MEMORY_STEP_MEMORY_H_
#define CONTROLLER_MEMORY_STEP_MEMORY_H_

#include "controller/rbd/rbd_manifold.h"
#include "controller/tab/tab_gpr.h"
#include "controller/tab/tab_pca.h"

#include <cmath>
#include <cstring>

namespace engram {

struct StepTables {
  const TabGpr* regression;  // features -> coefficients (of the path, then of the torques)
  const TabPca* path;        // -> dq at knots 0 .. N (N + 1, nv) of the left foot's steps
  const TabPca* torque;      // -> u (N, nu)
};

inline constexpr int kStepFeatures = 15, kStepMaxCoefficients = 192;
inline constexpr int kStepFade = 8;  // knots

// A step. Poses (x, y, yaw) [m, rad] in any one frame of the ground.
struct StepTask {
  double feet[2][3];            // left and right at its beginning
  double goal[3];               // where `foot` goes
  int foot = 0;                 // that swings: 0 left, 1 right
  bool from_walk = false;       // another step came before; or the robot is at rest
  bool into_walk = false;       // another step comes after; or the robot comes to rest
  double previous[3] = {};      // from_walk: where the foot that stands now stood before it swung
  double next[3] = {};          // into_walk: where the foot that stands now goes in the step after
  double ground = 0.0;          // height of the feet [m]
};

// The first knot of a step, and the last, where the one after begins: 0 and Task::nknots at rest; in a walk in the middle of the
// gait_between knots on both feet.
template <class Task> constexpr int step_first(const StepTask& t) {
  return t.from_walk ? static_cast<int>(Task::gait_before - Task::gait_between / 2) : 0;
}
template <class Task> constexpr int step_last(const StepTask& t) {
  return t.into_walk ? static_cast<int>(Task::gait_before + Task::gait_swing + Task::gait_between / 2) : Task::nknots;
}

// Task: tables/<robot>_<task>/task.h; Mirror: which driven dof takes which other one's place, and its sign, seen in a mirror.
template <class Task> struct StepGuess {
  using R = typename Task::Robot;
  static constexpr int N = Task::nknots;
  double x[N + 1][R::nq + R::nv];  // x[first] is the state that was given
  double u[N][R::nu];
  int first, last;    // knots of x that are filled; of u all but the last
  TabStatus status;   // kTabOutside: the task lies outside what was learnt
};

template <class Task> struct StepWork {
  using R = typename Task::Robot;
  alignas(64) float z[kStepMaxCoefficients + TAB_LANES], z_torque[kStepMaxCoefficients + TAB_LANES];
  alignas(64) float path[(Task::nknots + 1) * R::nv + TAB_LANES], torque[Task::nknots * R::nu + TAB_LANES];
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
  if (!checked(tables.regression ? &tables.regression->head : nullptr, kTabGpr)) return kTabBad;
  if (!checked(tables.path ? &tables.path->head : nullptr, kTabPca)) return kTabBad;
  if (!checked(tables.torque ? &tables.torque->head : nullptr, kTabPca)) return kTabBad;
  const TabGpr& z = *tables.regression;
  const bool fit = tables.path->n == (Task::nknots + 1) * R::nv && tables.torque->n == Task::nknots * R::nu && z.d == kStepFeatures &&
                   z.m == tables.path->m + tables.torque->m && z.m <= kStepMaxCoefficients;
  if (fit) return kTabOk;
  constexpr char kMisfit[] = "the tables of steps do not fit each other; run 'engram fit talos step' and build again";
  static_assert(sizeof kMisfit <= TAB_TEXT, "fits the caller's buffer");
  std::memcpy(text, kMisfit, sizeof kMisfit);
  return kTabBad;
}

// The features of a step: start, goal, previous and next (x, y, yaw), each in the axes of the foot that stands meanwhile; whether it
// comes from a walk and goes into one; the foot.
inline void step_features(const StepTask& t, double (&x)[kStepFeatures]) {
  const double mirror = t.foot == 0 ? 1.0 : -1.0;
  const auto see = [&](const double* frame, const double* at, double* seen) {
    const double c = std::cos(frame[2]), s = std::sin(frame[2]), dx = at[0] - frame[0], dy = at[1] - frame[1];
    seen[0] = c * dx + s * dy;
    seen[1] = mirror * (-s * dx + c * dy);
    seen[2] = mirror * (at[2] - frame[2]);
  };
  const double* const stands = t.feet[1 - t.foot];
  std::memset(x, 0, sizeof x);
  see(stands, t.feet[t.foot], x);
  see(stands, t.goal, x + 3);
  if (t.from_walk) see(t.feet[t.foot], t.previous, x + 6);
  if (t.into_walk) see(t.goal, t.next, x + 9);
  x[12] = t.from_walk;
  x[13] = t.into_walk;
  x[14] = t.foot;
}

// The posture at home between the feet at the beginning of a step: q (nq).
template <class R> void step_level(const StepTask& t, double* q) {
  std::memcpy(q, R::q_home, sizeof(R::q_home));
  for (int i = 0; i < 2; ++i) q[i] = 0.5 * (t.feet[0][i] + t.feet[1][i]);
  q[2] += t.ground;
  const double half = 0.25 * (t.feet[0][2] + t.feet[1][2]);  // of the heading
  q[3] = q[4] = 0.0;
  q[5] = std::sin(half);
  q[6] = std::cos(half);
}

// The guess of the coefficients w.z, from knot `at` of the step on, where the robot has the state x0.
template <class Task, class Mirror>
void step_decode(const StepTables& tables, const StepTask& task, int at, const double* x0, StepWork<Task>& w, StepGuess<Task>& guess) {
  using R = typename Task::Robot;
  constexpr int nq = R::nq, nv = R::nv, nu = R::nu, base = nv - nu;
  static_assert(base == 6 && Mirror::nu == nu, "a free base and driven joints");
  std::memcpy(w.z_torque, w.z + tables.path->m, sizeof(float) * tables.torque->m);
  tab_pca_decode(tables.path, w.z, w.path);
  tab_pca_decode(tables.torque, w.z_torque, w.torque);

  const bool left = task.foot == 0;
  double level[nq], off[nv];
  step_level<R>(task, level);
  const auto remembered = [&](int k, double* q) {
    const float* const dq = w.path + k * nv;
    double moved[nv];
    for (int i = 0; i < base; ++i) moved[i] = left ? dq[i] : Mirror::base[i] * dq[i];
    for (int i = 0; i < nu; ++i) moved[base + i] = left ? dq[base + i] : Mirror::sign[i] * dq[base + Mirror::other[i]];
    rbd_integrate<R>(level, moved, q);
  };
  double q[nq];
  remembered(at, q);
  rbd_difference<R>(q, x0, off);
  guess.first = at;
  guess.last = step_last<Task>(task);
  std::memcpy(guess.x[at], x0, sizeof(guess.x[at]));
  for (int k = at; k < guess.last; ++k) {
    const float* const u = w.torque + k * nu;
    for (int i = 0; i < nu; ++i) guess.u[k][i] = left ? u[i] : Mirror::sign[i] * u[Mirror::other[i]];
    const double s = std::fmin(1.0, (k + 1 - at) / static_cast<double>(kStepFade)), rest = 1.0 - s * s * s * (10.0 + s * (-15.0 + 6.0 * s));
    double fading[nv], moved[nv];
    for (int i = 0; i < nv; ++i) fading[i] = rest * off[i];
    remembered(k + 1, q);
    rbd_integrate<R>(q, fading, guess.x[k + 1]);
    rbd_difference<R>(guess.x[k], guess.x[k + 1], moved);
    for (int i = 0; i < nv; ++i) guess.x[k + 1][nq + i] = moved[i] / Task::dt;
  }
}

// The guess from knot `at` of the step on, where the robot has the state x0 (nq + nv): measured, or the last of the plan that is continued.
// False if a number is not finite or `at` is no knot of the step before its last: no guess.
template <class Task, class Mirror>
bool step_query(const StepTables& tables, const StepTask& task, int at, const double* x0, StepWork<Task>& w, StepGuess<Task>& guess) {
  using R = typename Task::Robot;
  if (at < step_first<Task>(task) || at >= step_last<Task>(task)) return false;
  for (int i = 0; i < R::nq + R::nv; ++i)
    if (!std::isfinite(x0[i])) return false;
  double features[kStepFeatures];
  step_features(task, features);
  guess.status = tab_gpr_query(tables.regression, features, w.z, nullptr);
  if (guess.status == kTabNotFinite) return false;
  step_decode<Task, Mirror>(tables, task, at, x0, w, guess);
  return true;
}

}  // namespace engram
#endif  // CONTROLLER_MEMORY_STEP_MEMORY_H_
