// The memory of motion: a state and a task in, guesses of the optimal motion (xs, us) with a trust figure out.
//
// What is remembered of a motion is its posture at the end and its bow: how it deviates from the minimum-jerk straight line between
// its own ends. Bent to another start and another end, the bow stays (memory_warp.h). Kinds of guesses:
//
//   neighbour   end and bow of one of the motions nearest in task space; inverse kinematics corrects the end for the goal
//   mixture,    end and leading coefficients of the bow of one of the modes that a mixture over tasks and motions, or a network, holds
//   network     likely here; inverse kinematics corrects the end: many modes in few bytes
//   train       one of the postures that a tensor train over goals and postures holds likely, corrected; its bow as a regression's
//   line        no bow: a straight line to an inverse kinematics solution
//   regression  the same end as a line, and the bow that a Gaussian process predicts between start and end. (Between given ends
//               the bow is nearly unique; as a function of the task alone it has many modes, which regression would average.)
//
// States and controls are remembered together: the coefficients are those that lose least of both, and decode to the bow and to what
// the solver's controls were beyond the inverse dynamics of the decoded motion. A guess is a motion without gaps: velocities are
// those of the path, controls its inverse dynamics; with MemoryOpts::recall_controls the remembered difference is added to them.
// The memory composes guesses; it does not rank them: that is the merit's business, in loop/.
//
// Templates over a Task (tables/<robot>_<task>/task.h). No heap, no exceptions, no I/O; bounded: operations are stated below.
#ifndef CONTROLLER_MEMORY_MEMORY_H_
#define CONTROLLER_MEMORY_MEMORY_H_

#include "controller/ocp/ocp_reach.h"
#include "controller/tab/tab_eval.h"
#include "controller/tab/tab_gpr.h"
#include "controller/tab/tab_knn.h"
#include "controller/tab/tab_logit.h"
#include "controller/tab/tab_pca.h"
#include "controller/tab/tab_rbf.h"
#include "controller/tab/tab_tt.h"

#include <cstdint>

namespace engram {

enum class GuessKind : int32_t { kNeighbour, kRegression, kLine, kMixture, kTrain, kNetwork };
inline constexpr int kGuessKinds = 6;

inline constexpr int kMemoryPool = 24;       // samples looked up; those whose end cannot be corrected make room for the next
inline constexpr int kMemoryNeighbours = 8;  // most neighbours of an answer
inline constexpr int kMemoryLearners = 2;    // mixtures and networks
inline constexpr int kMemoryModes = 4;       // most modes of one of them
inline constexpr int kMemoryTrains = 4;      // most postures of the tensor train
inline constexpr int kMemoryLines = 3;       // to the end of the best neighbour, to one found from home, to one found from here (or elsewhere)
inline constexpr int kMemoryGuesses = kMemoryNeighbours + kMemoryLearners * kMemoryModes + kMemoryTrains + 2 * kMemoryLines;

struct MemoryOpts {
  int neighbours = kMemoryNeighbours;  // 0 .. kMemoryNeighbours
  int modes = kMemoryModes;            // 0 .. kMemoryModes, of each learner
  int trains = kMemoryTrains;          // 0 .. kMemoryTrains
  int lines = kMemoryLines;            // 0 .. kMemoryLines; the first needs neighbours
  bool regression = true;              // a regression beside every line
  bool recall_controls = false;        // closer to the solver's controls, but no longer a motion: it opens gaps (docs/memory.md)
  int64_t elsewhere = 0;               // not 0: the last line's end is found from the posture of this random draw, not from here
  double (*clock)() = nullptr;         // [us] of CPU time; asked between the kinds of guesses, none: MemoryAnswer::us is 0
  double max_warp = 1.2;               // [rad] a neighbour, mode or sample whose end must turn a joint further is refused
};

// The tables of one robot and task.
struct MemoryTables {
  const TabKnn* knn;      // memory_features -> end posture (nq), coefficients of the bow (m)
  const TabGpr* gpr;      // memory_bow_features -> coefficients of the bow (m)
  const TabPca* bow;      // coefficients of the bow (m) -> weights over time (k, nq + nu) of bow and controls
  const TabRbf* time;     // the Gaussians over time, nq + nu channels; its domain [0, T] is the length of a remembered motion
  const TabLogit* trust;  // memory_trust_inputs -> probability that the solver succeeds
  // mixtures or networks: memory_features -> end posture (nq), leading coefficients of the bow; may be missing
  const TabHead* learner[kMemoryLearners] = {};
  const TabTt* train = nullptr;  // density over memory_pose (6) and posture (nq); may be missing
  MemoryOpts ensemble = {};      // how many guesses of each kind are worth their time: `engram fit` chooses
};

template <class Task> struct Guess {
  using R = typename Task::Robot;
  static constexpr int N = Task::nknots;
  GuessKind kind;
  // neighbour: index of its sample; mixture: of its component; network: of its member or mode; train: its rank by cost;
  // line, regression: 0 best neighbour's end, 1 found from home, 2 from here
  int32_t source;
  double trust;    // [0, 1] estimated probability that the solver succeeds from here
  double warp;     // [rad] largest joint difference between its end and where inverse kinematics started
  double x[N + 1][R::nq + R::nv];  // states at the knots; x[0] is the measured state
  double u[N][R::nu];              // controls that drive x (inverse dynamics), or the recalled ones; not clamped
};

// What a query found. Every query writes all but the guesses beyond n.
template <class Task> struct MemoryAnswer {
  int32_t n;          // guesses
  int32_t refused;    // samples and modes looked up whose end could not be corrected for the goal
  TabStatus status;   // kTabOutside: the task lies outside the tables' domain; kTabNotFinite: no guesses
  double distance;    // to the nearest sample, scaled [-]; infinite if the memory was not asked
  double deviation;   // of the surest regression, relative to its prior: 0 (known) .. 1 (unknown); 1 if it was not asked
  double us[kGuessKinds];  // by opts.clock: what the guesses of each kind took, decoding included
  Guess<Task> guess[kMemoryGuesses];
};

// Do the tables belong to this robot and task, are they whole, and do their sizes fit together? kTabOk, or kTabBad with one sentence
// in text (TAB_TEXT bytes). Init only. Defined in memory_check.h.
template <class Task> TabStatus memory_check(const MemoryTables& tables, char* text);

// Scratch of queries: nothing in it survives but what memory_init prepares. Not copied. Defined in memory_query.h.
template <class Task> struct MemoryWork;

// Once, before the first query: makes the train's sampler ready; without it there are no guesses of the train. The tables must have
// passed memory_check.
template <class Task> void memory_init(const MemoryTables& tables, MemoryWork<Task>& work);

// Guesses for reaching `goal` from the state x0 (nq + nv).
//
//   n      knots with a control, 1 <= n <= Task::nknots
//   t      (n + 1) knot times from now [s], t[0] = 0, increasing
//
// Guesses come in the order neighbours (nearest first), modes of each learner (likeliest first), trains (cheapest posture first), lines,
// regressions. An x0, goal or t that is not finite (or beyond 1e6) gives none. Defined in memory_query.h.
template <class Task>
void memory_query(const MemoryTables& tables, const MemoryOpts& opts, const ReachTarget& goal, const double* x0, int n,
                  const double* t, MemoryWork<Task>& work, MemoryAnswer<Task>& answer);

}  // namespace engram
#endif  // CONTROLLER_MEMORY_MEMORY_H_
