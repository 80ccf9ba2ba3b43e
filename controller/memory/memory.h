// The memory of motion: a state and a task in, guesses of the optimal motion (xs, us) with a trust figure out.
//
// Kinds of guesses (memory_query.h composes them; it never ranks them: that is the merit's business, in loop/):
//   neighbour   one of the remembered motions nearest in task space, warped to the measured state and to the goal
//   regression  the mean of a Gaussian process over the remembered motions, warped likewise
//   line        a minimum-jerk straight line in joint space to an inverse kinematics solution
// Every guess is a motion without gaps: velocities are those of the warped path, controls its inverse dynamics.
//
// Templates over a Task (tables/<robot>_<task>/task.h). No heap, no exceptions, no I/O; bounded: operations are stated below.
#ifndef CONTROLLER_MEMORY_MEMORY_H_
#define CONTROLLER_MEMORY_MEMORY_H_

#include "controller/ocp/ocp_reach.h"
#include "controller/tab/tab_gpr.h"
#include "controller/tab/tab_knn.h"
#include "controller/tab/tab_logit.h"
#include "controller/tab/tab_pca.h"
#include "controller/tab/tab_rbf.h"

#include <cstdint>

namespace engram {

// The tables of one robot and task. Inputs of knn and gpr: memory_features; their values: PCA coefficients of the motion, whose
// decoded numbers are RBF weights (k, nchannel), channels q (nq) then u (nu).
struct MemoryTables {
  const TabKnn* knn;
  const TabGpr* gpr;
  const TabPca* pca;
  const TabRbf* rbf;
  const TabLogit* trust;  // inputs: kMemoryTrustInputs numbers, see memory_query.h
};

enum class GuessKind : int32_t { kNeighbour, kRegression, kLine };

inline constexpr int kMemoryNeighbours = 10;                    // most neighbours of a query
inline constexpr int kMemoryLines = 3;                          // to the best neighbour's posture, from home, from here
inline constexpr int kMemoryGuesses = kMemoryNeighbours + 1 + kMemoryLines;

struct MemoryOpts {
  int neighbours = kMemoryNeighbours;  // 0: the memory is not asked
  bool regression = true;
  int lines = kMemoryLines;            // 0 .. kMemoryLines
  double max_warp = 1.2;               // [rad] a goal correction that turns a joint further refuses the guess
  double ik_tolerance = 1e-3;          // [m, rad] inverse kinematics worse than this refuses a warp
};

template <class Task> struct Guess {
  using R = typename Task::Robot;
  static constexpr int N = Task::nknots;
  GuessKind kind;
  int32_t source;               // neighbour: index of the sample; line: number of its start; regression: 0
  double trust;                 // [0, 1] estimated probability that the solver succeeds from here
  double warp;                  // [rad] largest joint correction at the goal
  double x[N + 1][R::nq + R::nv];  // states at the knots; x[0] is the measured state
  double u[N][R::nu];              // controls that drive x exactly (inverse dynamics), not clamped
};

// What a query found. Written completely by every query.
template <class Task> struct MemoryAnswer {
  int n;                 // guesses
  TabStatus status;      // kTabOutside: the task lies outside the tables' domain; kTabNotFinite: no guesses
  double distance;       // to the nearest sample, scaled [-]; infinite if the memory was not asked
  double deviation;      // of the Gaussian process, relative to its prior: 0 (known) .. 1 (unknown)
  int refused;           // neighbours and regressions refused by the warp
  Guess<Task> guess[kMemoryGuesses];
};

// Do the tables belong to this robot and task, are they whole, and do their sizes fit together? kTabOk, or kTabBad with one sentence
// in text (TAB_TEXT bytes). Init only. Defined in memory_check.h.
template <class Task> TabStatus memory_check(const MemoryTables& tables, char* text);

// Scratch of one query: nothing in it survives. Defined in memory_query.h.
template <class Task> struct MemoryWork;

// Guesses for reaching `goal` from the state x0 (nq + nv).
//
//   n      knots with a control, 1 <= n <= Task::nknots
//   t      (n + 1) knot times from now [s], t[0] = 0, increasing
//
// Guesses come in the order neighbours (nearest first), regression, lines; refused ones are left out. An x0, goal or t that is not
// finite gives no guess. Defined in memory_query.h.
template <class Task>
void memory_query(const MemoryTables& tables, const MemoryOpts& opts, const ReachTarget& goal, const double* x0, int n,
                  const double* t, MemoryWork<Task>& work, MemoryAnswer<Task>& answer);

}  // namespace engram
#endif  // CONTROLLER_MEMORY_MEMORY_H_
