// The memory of motion: a state and a task in, guesses of the optimal motion (xs, us) with a trust figure out.
//
// What is remembered of a motion is its posture at the end and its bow: how it deviates from the minimum-jerk straight line between
// its own ends. Bent to another start and another end, the bow stays (memory_warp.h). Kinds of guesses:
//
//   neighbour   one of the remembered motions nearest in task space, bent to the measured state and to the goal
//   regression  end and bow predicted by a Gaussian process over all of them, bent likewise
//   line        no bow: a straight line to an inverse kinematics solution
//
// Every guess is a motion without gaps: velocities are those of the path, controls its inverse dynamics. The memory composes
// guesses; it does not rank them: that is the merit's business, in loop/.
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

// The tables of one robot and task.
struct MemoryTables {
  const TabKnn* knn;      // memory_features -> end posture (nq), coefficients of the bow (m)
  const TabGpr* gpr;      // the same map
  const TabPca* bow;      // coefficients of the bow (m) -> its weights over time (k, nq)
  const TabRbf* time;     // the Gaussians over time, nq channels; its domain [0, T] is the length of a remembered motion
  const TabLogit* trust;  // memory_trust_inputs -> probability that the solver succeeds
};

enum class GuessKind : int32_t { kNeighbour, kRegression, kLine };

inline constexpr int kMemoryNeighbours = 10;  // most neighbours of a query
inline constexpr int kMemoryLines = 3;        // to the best neighbour's posture, to one found from home, to one found from here
inline constexpr int kMemoryGuesses = kMemoryNeighbours + 1 + kMemoryLines;

struct MemoryOpts {
  int neighbours = kMemoryNeighbours;  // 0 .. kMemoryNeighbours
  bool regression = true;
  int lines = kMemoryLines;     // 0 .. kMemoryLines; the first needs neighbours
  double max_warp = 1.2;        // [rad] a goal correction that turns a joint further refuses the guess
};

template <class Task> struct Guess {
  using R = typename Task::Robot;
  static constexpr int N = Task::nknots;
  GuessKind kind;
  int32_t source;  // neighbour: index of its sample; line: its number; regression: 0
  double trust;    // [0, 1] estimated probability that the solver succeeds from here
  double warp;     // [rad] largest joint correction of the end
  double x[N + 1][R::nq + R::nv];  // states at the knots; x[0] is the measured state
  double u[N][R::nu];              // controls that drive x (inverse dynamics), not clamped
};

// What a query found. Every query writes all but the guesses beyond n.
template <class Task> struct MemoryAnswer {
  int32_t n;          // guesses
  int32_t refused;    // neighbours and regressions whose end could not be bent to the goal
  TabStatus status;   // kTabOutside: the task lies outside the tables' domain; kTabNotFinite: no guesses
  double distance;    // to the nearest sample, scaled [-]; infinite if the memory was not asked
  double deviation;   // of the regression, relative to its prior: 0 (known) .. 1 (unknown); 1 if it was not asked
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
