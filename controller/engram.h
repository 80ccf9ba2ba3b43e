// Engram: a model predictive controller with a memory of motion. The C11 door of the deployed library.
//
// One control period of `tick_us` (engram_describe), seen by the caller:
//
//     engram_feedback(c, utime, q, v);        // the state is here: finish the plan, fast
//     engram_command(c, utime, q, v, tau);    // torque; again at every later state until the next tick
//     engram_prepare(c, utime + tick_us);     // before the next state: look up, compare, iterate, linearize, sweep
//
// Memory: all of it is the caller's block of engram_sizeof() bytes. No heap, no I/O, no exceptions, no global state.
// Threads: engram_command may run on its own (fast) thread while one other thread (the planner) makes all other calls; the
// plan passes between them without locks. Different handles are independent.
// Units and frames: SI; times `utime` in microseconds of one monotonic clock (the plant's). q: free base position (m) and
// quaternion x y z w, then joints (rad, m); v: base velocity in body axes, linear (m/s) then angular (rad/s), then joints.
// Errors: `engram_error` says that a call at start-up was wrong, with a text that names the thing and the mend.
// `engram_status` says how a period ended; the controller has already reacted to it (engram_rung) and goes on.
#ifndef CONTROLLER_ENGRAM_H_
#define CONTROLLER_ENGRAM_H_

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define ENGRAM_VERSION "0.1.0"
#define ENGRAM_ALIGN 64       // alignment of the controller inside the caller's block; engram_sizeof covers the slack
#define ENGRAM_NX_MAX 128     // bound on nq + nv of any model
#define ENGRAM_NTASK_MAX 32   // bound on the length of a task vector
#define ENGRAM_KNOTS_MAX 64   // bound on the knots of a plan
#define ENGRAM_GUESSES_MAX 32 // bound on the candidates of one cycle
#define ENGRAM_DELAY_MAX_US 50000
#define ENGRAM_FEET_MAX 4     // bound on the feet of a robot

typedef struct engram_controller engram_controller;  // one controller, living in the caller's memory
typedef struct engram_model engram_model;            // one robot, task and memory, compiled in; read-only

// The models of this library. A program may use several.
extern const engram_model engram_panda_reach;
extern const engram_model engram_talos_stand;
extern const engram_model engram_talos_walk;
extern const engram_model engram_talos_pole;
extern const engram_model engram_anymal_trot;
extern const engram_model engram_hector_fly;
extern const engram_model engram_pendulum_swing;
extern const engram_model engram_unicycle_park;
extern const engram_model engram_bicopter_fly;

// ---- what a model is ----

typedef struct engram_description {
  const char* robot;        // "panda"
  const char* task;         // "reach"
  uint64_t robot_digest;    // of tables/<robot>/robot.h
  uint64_t task_digest;     // of tables/<robot>_<task>/task.h
  int32_t nq, nv, nu;       // configuration, velocity, control
  int32_t ntask;            // task vector
  int32_t knots;            // steps N of a plan; its states are N + 1
  double knot_dt;           // s, length of a whole knot
  int64_t tick_us;          // us, control period
} engram_description;

const char* engram_version(void);
const engram_description* engram_describe(const engram_model* model);
// Digest of all tables of the model's memory; 0: it has none.
uint64_t engram_table_digest(const engram_model* model);

// ---- outcomes ----

// The call was wrong. Start-up only.
typedef enum engram_error {
  ENGRAM_NO_ERROR = 0,
  ENGRAM_ERROR_NULL,        // an argument that must not be NULL is NULL
  ENGRAM_ERROR_MEMORY,      // the block is smaller than engram_sizeof()
  ENGRAM_ERROR_MODE,        // options.memory
  ENGRAM_ERROR_ITERATIONS,  // options.iterations, iterations_jump, starts or line_search
  ENGRAM_ERROR_BUDGET,      // options.budget_us, or a budget without a clock
  ENGRAM_ERROR_LIMITS,      // options.torque_rate, clearance_min, hold_rate or switch_gain
  ENGRAM_ERROR_WATCHDOG,    // options.state_gap_us, plan_age_us or off_after_us
  ENGRAM_ERROR_DELAY,       // options.delay_us
  ENGRAM_ERROR_TABLES,      // the memory's tables do not belong to this robot and task: rebuild them
} engram_error;

// One sentence that names the thing and the mend. Static storage; never NULL.
const char* engram_error_text(engram_error error);

// How a period ended.
typedef enum engram_status {
  ENGRAM_CONVERGED = 0,     // the plan meets the stopping threshold
  ENGRAM_ITERATING,         // the plan is better than before; iterations spent. The usual ending
  ENGRAM_DEADLINE,          // the plan is better than before; time spent
  ENGRAM_NO_DESCENT,        // no step length improved the plan: it stays, with fresh gains
  ENGRAM_NOT_POS_DEF,       // the sweep failed at the largest regularization
  ENGRAM_NOT_FINITE,        // the solver met a value that is not finite
  ENGRAM_COLLISION,         // the plan comes nearer to an obstacle than clearance_min: not executed
  ENGRAM_OPEN_GAPS,         // the plan is not yet a motion (gaps too large): not executed
  ENGRAM_TOO_FAST,          // the plan breaks a velocity limit in the near future: not executed
  ENGRAM_NO_TASK,           // no task yet: holds
  ENGRAM_BAD_TASK,          // task refused: wrong length, not finite; the last one stays
  ENGRAM_TASK_FAR,          // task taken, but outside the range the memory was built for: memory is not asked
  ENGRAM_BAD_STATE,         // state refused: not finite, or beyond any physical range
  ENGRAM_STALE_STATE,       // time went backwards, or no good state for longer than state_gap_us
  ENGRAM_STALE_PLAN,        // no new plan for longer than plan_age_us: holds
  ENGRAM_STATUS_COUNT
} engram_status;

// A few words. Static storage; never NULL.
const char* engram_status_text(engram_status status);

// The fall-back ladder: what drives the torque. Every rung is safer and less able than the one before.
typedef enum engram_rung {
  ENGRAM_RUNG_PLAN = 0,     // the plan of this period
  ENGRAM_RUNG_SHIFTED,      // the last good plan, shifted
  ENGRAM_RUNG_HOLD,         // keep the posture, with the dynamics compensated
  ENGRAM_RUNG_DAMPING,      // gravity compensation and joint damping
  ENGRAM_RUNG_OFF,          // zero torque
  ENGRAM_RUNG_COUNT
} engram_rung;
const char* engram_rung_text(engram_rung rung);

// Where a guess came from.
typedef enum engram_candidate {
  ENGRAM_CANDIDATE_SHIFTED = 0,  // the last plan, shifted
  ENGRAM_CANDIDATE_KNN,          // a remembered motion, warped to state and goal
  ENGRAM_CANDIDATE_GPR,          // Gaussian process regression
  ENGRAM_CANDIDATE_GMR,          // a mode of a mixture of motions
  ENGRAM_CANDIDATE_LINE,         // straight line in joint space to an inverse kinematics solution
  ENGRAM_CANDIDATE_COLD,         // stand still under gravity torque
  ENGRAM_CANDIDATE_TT,           // a posture sampled from a tensor train, and the way there by regression
  ENGRAM_CANDIDATE_MLP,          // a mode of a mixture density network, or the answer of a network
  ENGRAM_CANDIDATE_COUNT
} engram_candidate;
const char* engram_candidate_text(engram_candidate candidate);

// ---- options ----

typedef enum engram_mode {
  ENGRAM_MODE_MEMORY = 0,  // shifted plan, remembered motions, regression, straight lines: lowest merit wins
  ENGRAM_MODE_LINE,        // shifted plan and straight lines
  ENGRAM_MODE_SHIFT,       // shifted plan only
  ENGRAM_MODE_COLD,        // at a jump stand still, else the shifted plan
  ENGRAM_MODE_COUNT
} engram_mode;

// Microseconds of a clock that never goes back (thread CPU time, cycle counter). Called by the planner thread only.
typedef double (*engram_clock)(void);

typedef struct engram_options {
  engram_mode memory;       // which guesses are tried
  int32_t iterations;       // 1 to 50, FDDP iterations per period
  int32_t iterations_jump;  // 1 to 50, in the period after a jump, from each start
  int32_t starts;           // 1 to 8, most guesses that are iterated after a jump; they end in different postures
  int32_t line_search;      // 1 to 10, step lengths tried per iteration: 1, 1/2, 1/4 ...
  double budget_us;         // us, 0 to 1e6: no further iteration begins after it. 0: iterations alone count (reproducible)
  engram_clock clock;       // times the phases and the budget; NULL: no times, and budget_us must be 0
  double torque_rate;       // > 0, largest change of a torque in units of its limit per second (1/s). Plans step from knot to knot:
                            // a rate below some 100 per second distorts them
  double clearance_min;     // m, a plan that comes nearer to an obstacle is not executed
  double switch_gain;       // 0 to 1: another guess replaces a good shifted plan when its merit is below (1 - gain) of it
  double hold_rate;         // 1 to 100, bandwidth of the hold controller (rad/s)
  int64_t delay_us;         // us, 0 to 50000: known time from a state to the effect of the command that answers it
  int64_t state_gap_us;     // us, >= tick: longest time without a good state before the plan is dropped
  int64_t plan_age_us;      // us, >= tick: longest time without a new plan before the controller holds
  int64_t off_after_us;     // us, >= state_gap_us: longest time without a good state before the torque goes to zero
} engram_options;

// The values the demo runs with.
void engram_default_options(const engram_model* model, engram_options* options);

// ---- life ----

// Bytes of the caller's block for this model, alignment slack included.
size_t engram_sizeof(const engram_model* model);

// Builds a controller in `memory` (any alignment) and writes its handle, a pointer into the block. It holds until its first
// task. `options` NULL: the defaults. Nothing to free. On error the handle is NULL.
engram_error engram_init(const engram_model* model, void* memory, size_t bytes, const engram_options* options,
                         engram_controller** handle);

// Forgets task, plan and state, keeps the options: the plant has restarted. Neither thread may be inside a call.
void engram_reset(engram_controller* handle);

const engram_model* engram_model_of(const engram_controller* handle);

// ---- one period ----

// What to do from `utime` on: the task vector (names, units, order of models/<robot>/<task>/task.toml). A new `jump` number
// starts the motion's clock anew; the same number moves the target of the motion under way.
// Returns ENGRAM_CONVERGED (taken), ENGRAM_TASK_FAR (taken) or ENGRAM_BAD_TASK (refused).
engram_status engram_set_task(engram_controller* handle, int64_t utime, int32_t jump, const double* value, int32_t n);

// Plans for the state expected at `utime`, the next tick: all the work that can be done before the state is known.
engram_status engram_prepare(engram_controller* handle, int64_t utime);

// Takes the state q (nq), v (nv) measured at `utime`, finishes the plan, checks it, and hands it to engram_command.
engram_status engram_feedback(engram_controller* handle, int64_t utime, const double* q, const double* v);

// Torque for the state q (nq), v (nv) measured at `utime`:
//     tau = u*(t) - K(t) (x [-] x*(t)),  t: when it acts (options.delay_us), x predicted so far,  then clamped to the torque limits and to torque_rate.
// x*, u*, K: the plan, at its knot and moved along it to `utime`; K = - d tau / d x (nu x 2 nv), x [-] x* = (q [-] q*, v - v*).
// On the lower rungs the law of that rung. `tau` (nu) in N m (or N) is always finite, whatever the state.
engram_status engram_command(engram_controller* handle, int64_t utime, const double* q, const double* v, double* tau);

// The memory as a metric: of n goals (n rows of ntask, as engram_set_task takes them), the one to which the memory holds the cheapest
// motion from the state q (nq), v (nv); nothing is solved. Its index, the first among equals.
// merit (n) out: of the best guess for each goal, as engram_cycle.merit; +infinity without one, and for a goal that is not finite or
// outside the range of the memory. -1: no goal has a guess, the state is not finite, or this model has no such memory.
// For the planner thread, between engram_feedback and engram_prepare (else -1). One query of the memory for each goal.
int32_t engram_choose_goal(engram_controller* handle, const double* q, const double* v, const double* goals, int32_t n, double* merit);

// ---- what happened ----

// Where feet and centre of mass of a robot on legs are asked to be, at the cycle's utime. World axes.
typedef struct engram_legs {
  int32_t nfeet;                          // used rows of foot; 0: no robot on legs
  int32_t swing;                          // feet in the air, bit f for foot f
  double foot[ENGRAM_FEET_MAX][4];        // where foot f stands, or where it shall land: x, y, z [m], heading [rad]
  double com[3];                          // m, where the centre of mass shall be
} engram_legs;

// The last cycle that engram_feedback has ended.
typedef struct engram_cycle {
  int64_t utime;                          // us, time of the plan's first knot
  int64_t seq;                            // counts cycles from 1
  int32_t jump;                           // jump counter of the task the plan serves; 0: none yet
  engram_status status;
  engram_rung rung;
  engram_candidate winner;                // guess that seeded the solver
  int32_t iterations;                     // FDDP iterations spent
  int32_t nguess;                         // used entries of the next two
  engram_candidate guess[ENGRAM_GUESSES_MAX];
  double merit[ENGRAM_GUESSES_MAX];       // cost + weight * L1 norm of the gaps; Talos at the pole: cost once these are rolled out
  double cost;                            // of the plan
  double gap;                             // L1 norm of its gaps
  double clearance;                       // m, smallest distance between a collision sphere and an obstacle along the plan
  double trust;                           // of the memory in its best guess, 0 to 1
  int32_t npath;                          // used rows of path
  double path[ENGRAM_KNOTS_MAX][3];       // m, planned hand position in the world, one row per knot
  double query_us, candidates_us, linearize_us, backward_us, rollout_us, total_us;  // by options.clock; 0 without one
  double asked_us[ENGRAM_CANDIDATE_COUNT];  // of query_us: what the memory's guesses of each kind took
  engram_legs legs;
} engram_cycle;
void engram_cycle_info(const engram_controller* handle, engram_cycle* cycle);

// The optimal control problem that the last jump posed (whole knots from the expected state x0) and how fast it was solved from the
// guess of lowest merit: merit of the guess, and after each iteration of the jump's own period.
#define ENGRAM_JUMP_ITERATIONS 50
typedef struct engram_jump {
  int32_t jump;                              // 0: none yet
  int64_t utime;                             // us, time of the first knot
  engram_candidate winner;
  int32_t niterations;                       // used entries of merit, less one
  double x0[ENGRAM_NX_MAX];                  // expected state (q, v)
  double task[ENGRAM_NTASK_MAX];             // task vector
  double merit[ENGRAM_JUMP_ITERATIONS + 1];  // [0] of the guess, [k] after iteration k; cost + weight * L1 norm of the gaps
} engram_jump;
void engram_jump_info(const engram_controller* handle, engram_jump* jump);

// The plan under way: knot times (N + 1) in us, states x (N + 1 rows of nq + nv), controls u (N rows of nu), gains
// K (N blocks of nu x 2 nv, row-major, sign as in engram_command). Any pointer may be NULL. Returns N; 0: no plan.
int32_t engram_plan(const engram_controller* handle, int64_t* utime, double* x, double* u, double* K);

#ifdef __cplusplus
}
#endif
#endif  // CONTROLLER_ENGRAM_H_
