// The planner side of the loop: one control period, cut in two at the arrival of the state.
//
//   prepare   predict the state at the next tick; collect the guesses (shifted plan, remembered motions, regressions, lines); the
//             lowest merit seeds FDDP; iterate; linearize and sweep once more
//   feedback  roll out from the measured state; check the new plan (finite, gaps, clearance); hand it to the fast side
//
// At a jump the best few guesses that end in different postures are iterated, and the best result goes on.
//
// Knots sit at absolute times. A plan that passes the check is `plan_`: it is executed, and its shift is a guess of the next period.
// A new plan that does not pass is not lost if the solver is only not done: it is postponed, to begin a tick later.
// A solve that failed (not finite, not positive definite) seeds nothing.
#ifndef CONTROLLER_LOOP_LOOP_PLANNER_H_
#define CONTROLLER_LOOP_LOOP_PLANNER_H_

#include "controller/loop/loop_fast.h"
#include "controller/loop/loop_guesses.h"
#include "controller/loop/loop_solve.h"

namespace engram {

// A plan is executed although its gaps (L1, rad and rad/s) are not quite closed: the next period closes them before they are reached,
// if they are small, and smaller still in the near future.
inline constexpr int kNearKnots = 10;
inline constexpr double kLargestNearGap = 0.1;
inline constexpr double kLargestGap = 0.5;
// Largest speed in the near future, of the velocity limit; a robot that is faster already may brake.
inline constexpr double kLargestSpeed = 1.0;
inline constexpr double kAstray = 0.9;  // share of what counts as success, beyond which the plan under way misses its target
inline constexpr int kRivals = 5;       // guesses that are tried in turn while the plan does not end at the target

template <class M> class Planner {
 public:
  using P = typename M::P;
  static constexpr int N = M::N, nx = P::nx, nq = P::nq, nv = P::nv;

  Planner(const engram_options& options, FastLoop<P, N>& fast) : options_(options), fast_(fast), solve_(options) {}

  engram_status set_task(int64_t utime, int32_t jump, const double* value, int n);
  engram_status prepare(int64_t utime);
  engram_status feedback(int64_t utime, const double* q, const double* v);

  const engram_cycle& cycle() const { return finished_; }
  const engram_jump& jump() const { return jump_; }
  const Plan<P, N>& plan() const { return plan_; }

 private:
  // Where the trajectory in `solve_` stands.
  enum class Trial {
    kNone,       // nothing worth a further iteration
    kReady,      // swept, waiting for the state
    kPostponed,  // sound, but not yet fit to be executed
  };
  struct Task {
    int64_t utime;
    int32_t jump;
    double value[M::ntask];
    typename M::Target target;
    bool known;  // within the range of the memory
  };
  // The best of several starts.
  struct Result {
    Seed<P, N> seed;
    double score, reg;
  };

  void begin_period();
  void take_task(int64_t utime);
  void predict(int64_t utime, double* x) const;
  void collect(bool postponed, const Deadline& deadline);
  bool search(bool waiting, Deadline& deadline);
  double score(double nearest) const;
  double nearest_allowed() const;
  void record_start(const Candidate<P>& guess);
  void record_merit(int iteration);
  engram_status judge(bool accepted);
  engram_status finish(engram_status status, engram_rung rung, const Deadline& deadline);
  void drop_plan();

  const engram_options& options_;
  FastLoop<P, N>& fast_;

  bool has_task_ = false, task_pending_ = false;
  Task task_, pending_;
  bool jumped_ = false;     // the next problem is the first of a jump
  int32_t plan_jump_ = 0;   // jump that `plan_` serves
  int64_t jump_utime_ = 0;  // us, first knot of the jump's first problem

  StateWatch<P> watch_;
  Plan<P, N> plan_;  // executed; n = 0: none
  Solve<M> solve_;
  Trial trial_ = Trial::kNone;
  engram_status ending_ = ENGRAM_ITERATING;  // of the iterations before the feedback
  Guesses<M> guesses_;
  Result best_;

  bool prepared_ = false;  // cycle_ belongs to the period under way
  engram_cycle cycle_ = {}, finished_ = {};
  engram_jump jump_ = {};
  int64_t seq_ = 0;
};

template <class M> engram_status Planner<M>::set_task(int64_t utime, int32_t jump, const double* value, int n) {
  if (n != M::ntask || !all_finite(value, n)) return ENGRAM_BAD_TASK;
  Task task;
  if (!M::target(value, task.target)) return ENGRAM_BAD_TASK;
  task.utime = utime;
  task.jump = jump;
  task.known = M::known(value);
  std::memcpy(task.value, value, sizeof(task.value));
  pending_ = task;
  task_pending_ = true;
  return task.known ? ENGRAM_CONVERGED : ENGRAM_TASK_FAR;
}

template <class M> void Planner<M>::begin_period() {
  cycle_ = engram_cycle{};
  solve_.clear();
  guesses_.clear();
  ending_ = ENGRAM_ITERATING;
}

// The pending task becomes the task once its time has come.
template <class M> void Planner<M>::take_task(int64_t utime) {
  if (!task_pending_ || pending_.utime > utime) return;
  jumped_ = jumped_ || !has_task_ || pending_.jump != task_.jump;
  task_ = pending_;
  has_task_ = true;
  task_pending_ = false;
}

// The last measured state, carried along by what the plan moves until utime.
template <class M> void Planner<M>::predict(int64_t utime, double* x) const {
  if (plan_.n == 0) {
    std::memcpy(x, watch_.x, sizeof(double) * nq);
    std::memset(x + nq, 0, sizeof(double) * nv);
    return;
  }
  double planned[nx], then[nx], dx[P::Layout::nxp];
  plan_state(plan_, watch_.utime, planned);
  plan_state(plan_, utime, then);
  P::difference(planned, watch_.x, dx);
  P::integrate(then, dx, x);
}

// The guesses for the posed problem, and their merits.
template <class M> void Planner<M>::collect(bool postponed, const Deadline& deadline) {
  const double begin = deadline.now();
  const double* const x0 = solve_.horizon.x0;
  const bool cold = options_.memory == ENGRAM_MODE_COLD && jumped_;
  if (!cold && plan_.n > 0) guesses_.add_shifted(plan_, solve_.plan.utime, x0);
  if (!cold && !jumped_ && postponed) guesses_.add_postponed(solve_.plan, x0);
  if (guesses_.n == 0) guesses_.add_standing_still(x0);
  if (options_.memory == ENGRAM_MODE_MEMORY || options_.memory == ENGRAM_MODE_LINE) {
    guesses_.ask_memory(task_.target, options_.memory == ENGRAM_MODE_MEMORY && task_.known, x0, solve_.plan.utime);
  }
  const double asked = deadline.now();
  guesses_.compare(solve_.horizon);
  cycle_.query_us = asked - begin;
  cycle_.candidates_us = deadline.now() - asked;
  cycle_.nguess = guesses_.n;
  for (int i = 0; i < guesses_.n; ++i) {
    cycle_.guess[i] = guesses_.candidate[i].kind;
    cycle_.merit[i] = guesses_.candidate[i].merit;
    cycle_.trust = std::max(cycle_.trust, guesses_.candidate[i].trust);
  }
}

template <class M> void Planner<M>::record_start(const Candidate<P>& guess) {
  jump_ = engram_jump{};
  jump_.jump = task_.jump;
  jump_.utime = solve_.plan.utime[0];
  jump_.winner = guess.kind;
  jump_.merit[0] = guess.merit;
  std::memcpy(jump_.x0, solve_.horizon.x0, sizeof(solve_.horizon.x0));
  std::memcpy(jump_.task, task_.value, sizeof(task_.value));
}

template <class M> void Planner<M>::record_merit(int iteration) {
  if (iteration > ENGRAM_JUMP_ITERATIONS) return;
  jump_.merit[iteration] = solve_.merit();
  jump_.niterations = iteration;
}

// Smallest clearance a plan from here may have: a robot that is too near already may still leave.
template <class M> double Planner<M>::nearest_allowed() const {
  return std::min(options_.clearance_min, M::template clearance<double>(solve_.horizon.x0) - 1e-3);
}

// Merit of the trajectory as it stands; none makes up for a collision, or for a bad end: that is a local minimum, which the receding
// horizon would not leave again.
template <class M> double Planner<M>::score(double nearest) const {
  constexpr double kCollision = 1e6, kElsewhere = 200.0;
  const bool collides = solve_.look_along(nullptr) < nearest, ends_well = M::ends_well(task_.target, solve_.plan.s.x[N]);
  return solve_.merit() + (collides ? kCollision : 0.0) + (ends_well ? 0.0 : kElsewhere);
}

// Iterates from the best guess; while the robot waits for a plan, from others too that end elsewhere; and while the plan does not end
// at the target, from one such other in turn. Readies the best result. False if all solves failed.
template <class M> bool Planner<M>::search(bool waiting, Deadline& deadline) {
  const bool astray = !waiting && !M::arrived(task_.target, plan_.s.x[N], kAstray);
  const int starts = waiting ? options_.starts : astray ? 2 : 1;
  const double resumed_reg = solve_.reg(), nearest = nearest_allowed();
  best_.score = HUGE_VAL;
  for (int s = 0; s < starts && (s == 0 || !deadline.late()); ++s) {
    const int rank = astray ? static_cast<int>(seq_ % kRivals) : 0;
    const Candidate<P>* const guess = s == 0 ? guesses_.best(jumped_ ? 0.0 : options_.switch_gain) : guesses_.another(rank);
    if (guess == nullptr) break;
    if (s == 0) cycle_.winner = guess->kind;
    const bool recorded = jumped_ && s == 0;
    if (recorded) record_start(*guess);
    solve_.start(guess->x, guess->u, guess->kind == ENGRAM_CANDIDATE_SHIFTED && !jumped_ ? resumed_reg : 0.0);
    const bool sound = solve_.improve((waiting || s > 0 ? options_.iterations_jump : options_.iterations) - 1, deadline, [&] {
      if (recorded) record_merit(solve_.stats.iterations);
    });
    if (!sound) {
      ending_ = solve_.failure();
      continue;
    }
    if (starts == 1) return solve_.ready() || (ending_ = solve_.failure(), false);
    const double score_here = score(nearest);
    if (!(score_here < best_.score)) continue;
    cycle_.winner = guess->kind;
    best_.score = score_here;
    best_.reg = solve_.reg();
    std::memcpy(best_.seed.x, solve_.plan.s.x, sizeof(best_.seed.x));
    std::memcpy(best_.seed.u, solve_.plan.s.u, sizeof(best_.seed.u));
  }
  if (best_.score == HUGE_VAL) return false;
  solve_.start(best_.seed.x, best_.seed.u, best_.reg);
  return solve_.ready() || (ending_ = solve_.failure(), false);
}

template <class M> engram_status Planner<M>::prepare(int64_t utime) {
  Deadline deadline(options_);
  begin_period();
  prepared_ = true;
  take_task(utime);
  const bool postponed = trial_ == Trial::kPostponed;
  trial_ = Trial::kNone;
  if (!has_task_ || !watch_.any) return ENGRAM_NO_TASK;
  if (jumped_) jump_utime_ = utime;
  const bool fresh = jumped_ || plan_.n == 0 || postponed;  // whole knots from utime on
  predict(utime, solve_.horizon.x0);
  solve_.pose(task_.target, jump_utime_, utime, fresh ? utime : plan_.utime[1]);
  collect(postponed, deadline);
  if (search(fresh || plan_jump_ != task_.jump, deadline)) {
    trial_ = Trial::kReady;
    if (deadline.late()) ending_ = ENGRAM_DEADLINE;
  }
  jumped_ = false;
  cycle_.total_us = deadline.spent();
  return ending_;
}

// May the new plan be executed? The status says what stands against it.
template <class M> engram_status Planner<M>::judge(bool accepted) {
  cycle_.cost = solve_.plan.s.cost;
  cycle_.gap = solve_.open_gap(0, N);
  if (!solve_.finite()) return ENGRAM_NOT_FINITE;
  cycle_.npath = N + 1;
  cycle_.clearance = solve_.look_along(cycle_.path);
  if (!(cycle_.clearance >= nearest_allowed())) return ENGRAM_COLLISION;
  // gap 0 lies between the measured state and the first knot: the gains answer for it
  if (!(solve_.open_gap(1, kNearKnots) <= kLargestNearGap && solve_.open_gap(1, N) <= kLargestGap)) return ENGRAM_OPEN_GAPS;
  if (!(solve_.speed(1, kNearKnots) <= std::max(kLargestSpeed, solve_.speed(0, 0)))) return ENGRAM_TOO_FAST;
  if (ending_ == ENGRAM_DEADLINE) return ENGRAM_DEADLINE;
  if (!accepted) return ENGRAM_NO_DESCENT;
  return solve_.stop() < kStop ? ENGRAM_CONVERGED : ENGRAM_ITERATING;
}

template <class M> void Planner<M>::drop_plan() {
  plan_.n = 0;
  fast_.slot().n = 0;
  fast_.publish();
}

template <class M> engram_status Planner<M>::finish(engram_status status, engram_rung rung, const Deadline& deadline) {
  cycle_.seq = ++seq_;
  cycle_.jump = has_task_ ? task_.jump : 0;
  cycle_.status = status;
  cycle_.rung = std::max(rung, fast_.take_rung());
  cycle_.iterations = solve_.stats.iterations;
  cycle_.linearize_us = solve_.stats.us[kLinearize];
  cycle_.backward_us = solve_.stats.us[kBackward];
  cycle_.rollout_us = solve_.stats.us[kRollout];
  cycle_.total_us += deadline.spent();
  fast_.alive(cycle_.utime, status);
  finished_ = cycle_;
  return status;
}

template <class M> engram_status Planner<M>::feedback(int64_t utime, const double* q, const double* v) {
  const Deadline deadline(options_);
  if (!prepared_) begin_period();
  prepared_ = false;
  cycle_.utime = utime;
  const bool before = watch_.any && utime < watch_.utime;
  const int64_t blind = watch_.any ? utime - watch_.utime : 0;
  const bool good = !before && watch_.take(utime, q, v);
  const Trial trial = trial_;
  trial_ = Trial::kNone;
  if (before || blind > options_.state_gap_us) {  // the robot may be anywhere
    drop_plan();
    if (before) watch_.any = false;
    return finish(ENGRAM_STALE_STATE, ENGRAM_RUNG_HOLD, deadline);
  }
  if (!has_task_) return finish(good ? ENGRAM_NO_TASK : ENGRAM_BAD_STATE, ENGRAM_RUNG_HOLD, deadline);

  const bool has_plan = plan_.n > 0 && utime < plan_.utime[N];
  const engram_rung fallback = has_plan ? ENGRAM_RUNG_SHIFTED : ENGRAM_RUNG_HOLD;
  if (!has_plan && plan_.n > 0) drop_plan();
  const int64_t slip = utime - solve_.plan.utime[0];
  if (trial != Trial::kReady) return finish(ending_ == ENGRAM_ITERATING ? ENGRAM_DEADLINE : ending_, fallback, deadline);
  if (slip > M::kTickUs / 2 || slip < -M::kTickUs / 2) return finish(ENGRAM_DEADLINE, fallback, deadline);

  if (good) std::memcpy(solve_.horizon.x0, watch_.x, sizeof(solve_.horizon.x0));
  const engram_status status = judge(solve_.feedback(task_.target, jump_utime_, utime));
  if (status == ENGRAM_COLLISION || status == ENGRAM_OPEN_GAPS || status == ENGRAM_TOO_FAST) trial_ = Trial::kPostponed;
  if (status == ENGRAM_NOT_FINITE || trial_ == Trial::kPostponed) return finish(status, fallback, deadline);
  plan_ = solve_.plan;
  plan_jump_ = task_.jump;
  fast_.slot() = plan_;
  fast_.publish();
  return finish(good ? status : ENGRAM_BAD_STATE, ENGRAM_RUNG_PLAN, deadline);
}

}  // namespace engram
#endif  // CONTROLLER_LOOP_LOOP_PLANNER_H_
