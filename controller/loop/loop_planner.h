// The planner side of the loop: one control period, cut in two at the arrival of the state.
//
//   prepare   predict the state at the next tick; collect the guesses (shifted plan, remembered motions, regression, lines); the
//             lowest merit seeds FDDP; iterate; linearize and sweep once more
//   feedback  roll out from the measured state; check the new plan (finite, gaps, clearance); hand it to the fast side
//
// Knots sit at absolute times. A plan that passes the check is `plan_`: it is executed, and its shift is a guess of the next period.
// A new plan that does not pass is not lost if the solver is only not done: it waits as `trial_` and starts a tick later (postponed).
// A solve that failed (not finite, not positive definite) seeds nothing.
#ifndef CONTROLLER_LOOP_LOOP_PLANNER_H_
#define CONTROLLER_LOOP_LOOP_PLANNER_H_

#include "controller/fddp/fddp_solve.h"
#include "controller/loop/loop_fast.h"
#include "controller/loop/loop_merit.h"

namespace engram {

// A plan is executed although its gaps (L1, rad and rad/s) are not quite closed: the next period closes them before they are reached,
// if they are small, and smaller still in the near future.
inline constexpr int kNearKnots = 10;
inline constexpr double kLargestNearGap = 0.1;
inline constexpr double kLargestGap = 0.5;
inline constexpr double kStop = 1e-4;  // expected improvement below which a plan counts as converged

template <class M> class Planner {
 public:
  using P = typename M::P;
  static constexpr int N = M::N, nx = P::nx, nq = P::nq, nv = P::nv;

  Planner(const engram_options& options, FastLoop<P, N>& fast) : options_(options), fast_(fast) {
    solver_.step_lengths = options.line_search;
    solver_.now_us = options.clock;
    solver_.stop = kStop;
  }

  engram_status set_task(int64_t utime, int32_t jump, const double* value, int n);
  engram_status prepare(int64_t utime);
  engram_status feedback(int64_t utime, const double* q, const double* v);

  const engram_cycle& cycle() const { return finished_; }
  const engram_jump& jump() const { return jump_; }
  const Plan<P, N>& plan() const { return plan_; }

 private:
  // Where the trajectory in `trial_` stands.
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

  double now() const { return options_.clock ? options_.clock() : 0.0; }
  void begin_period();
  void take_task(int64_t utime);
  void predict(int64_t utime, double* x) const;
  void pose_problem(int64_t utime, int64_t phase);
  int collect();
  int choose(int n) const;
  bool iterate(double begin, int iterations);
  void record_merit();
  engram_status judge(bool accepted);
  void look_along_trial();
  engram_status finish(engram_status status, engram_rung rung, double begin);
  double open_gap(int first = 0, int last = N) const;
  void drop_plan();

  const engram_options& options_;
  FastLoop<P, N>& fast_;
  FddpOpts solver_;

  bool has_task_ = false, task_pending_ = false;
  Task task_, pending_;
  bool jumped_ = false;          // the next problem is the first of a jump
  int32_t plan_jump_ = 0;        // jump that `plan_` serves
  int64_t jump_utime_ = 0;       // us, first knot of the jump's first problem

  StateWatch<P> watch_;
  Plan<P, N> plan_;              // executed; n = 0: none
  Plan<P, N> trial_;             // being solved
  Trial trial_is_ = Trial::kNone;
  engram_status solve_ = ENGRAM_ITERATING;

  Horizon<P, N> horizon_;
  FddpWork<P, N> work_;
  FddpStats stats_;
  Seed<P, N> shifted_, other_;   // guesses of the loop's own
  typename M::Memory memory_;
  Candidate<P> candidates_[ENGRAM_GUESSES_MAX];
  static_assert(M::Memory::kGuesses + 2 <= ENGRAM_GUESSES_MAX, "room for the memory's guesses and the loop's own two");

  bool prepared_ = false;        // cycle_ and stats_ belong to the period under way
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
  stats_ = FddpStats{};
  solve_ = ENGRAM_ITERATING;
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

// Knot times and parameters of the problem that starts at utime; ends of whole knots lie on phase + m kStepUs.
template <class M> void Planner<M>::pose_problem(int64_t utime, int64_t phase) {
  horizon_.n = trial_.n = N;
  knot_times<N>(utime, phase, M::kStepUs, trial_.utime);
  for (int k = 0; k <= N; ++k) {
    M::knot(task_.target, k < N ? trial_.dt(k) : 0.0, 1e-6 * static_cast<double>(trial_.utime[k] - jump_utime_), horizon_.knot[k]);
  }
}

// Fills candidates_ for the posed problem; returns their number.
template <class M> int Planner<M>::collect() {
  const double begin = now();
  int n = 0;
  const bool cold = options_.memory == ENGRAM_MODE_COLD && jumped_;
  if (!cold && plan_.n > 0) {
    resample(plan_, trial_.utime, horizon_.x0, shifted_);
    candidates_[n++] = {ENGRAM_CANDIDATE_SHIFTED, shifted_.x, shifted_.u, 0.0, 0.0};
  }
  if (!cold && !jumped_ && trial_is_ == Trial::kPostponed) {
    std::memcpy(other_.x, trial_.s.x, sizeof(other_.x));
    std::memcpy(other_.u, trial_.s.u, sizeof(other_.u));
    std::memcpy(other_.x[0], horizon_.x0, sizeof(other_.x[0]));
    candidates_[n++] = {ENGRAM_CANDIDATE_SHIFTED, other_.x, other_.u, 0.0, 0.0};
  }
  if (n == 0) {
    stand_still(horizon_.x0, other_);
    candidates_[n++] = {ENGRAM_CANDIDATE_COLD, other_.x, other_.u, 0.0, 0.0};
  }
  if (options_.memory == ENGRAM_MODE_MEMORY || options_.memory == ENGRAM_MODE_LINE) {
    double t[N + 1];
    for (int k = 0; k <= N; ++k) t[k] = 1e-6 * static_cast<double>(trial_.utime[k] - trial_.utime[0]);
    n = memory_.guesses(task_.target, options_.memory == ENGRAM_MODE_MEMORY && task_.known, horizon_.x0, N, t, candidates_, n);
  }
  const double asked = now();
  loop_merit(horizon_, candidates_, n);
  cycle_.query_us = asked - begin;
  cycle_.candidates_us = now() - asked;
  cycle_.trust = 0.0;
  for (int i = 0; i < n; ++i) {
    cycle_.guess[i] = candidates_[i].kind;
    cycle_.merit[i] = candidates_[i].merit;
    cycle_.trust = std::max(cycle_.trust, candidates_[i].trust);
  }
  cycle_.nguess = n;
  return n;
}

// Index of the lowest merit. A good shifted plan gives way only to a clearly better guess, or the plan would flutter.
template <class M> int Planner<M>::choose(int n) const {
  int best = 0;
  for (int i = 1; i < n; ++i) {
    const bool incumbent = !jumped_ && candidates_[best].kind == ENGRAM_CANDIDATE_SHIFTED && candidates_[i].kind != ENGRAM_CANDIDATE_SHIFTED;
    if (candidates_[i].merit < (incumbent ? 1.0 - options_.switch_gain : 1.0) * candidates_[best].merit) best = i;
  }
  return best;
}

template <class M> void Planner<M>::record_merit() {
  const int i = stats_.iterations;
  if (!jumped_ || i > ENGRAM_JUMP_ITERATIONS) return;
  jump_.merit[i] = trial_.s.cost + kMeritWeight * open_gap();
  jump_.niterations = i;
}

// All but the last half of the last iteration. False if the solver failed: solve_ says how.
template <class M> bool Planner<M>::iterate(double begin, int iterations) {
  bool relinearize = true;
  double slowest = 0.0;
  for (int i = 1;; ++i) {
    const double start = now();
    const FddpStatus direction = fddp_direction(horizon_, solver_, relinearize, work_, trial_.s, stats_);
    if (direction == FddpStatus::kNotFinite) solve_ = ENGRAM_NOT_FINITE;
    if (direction == FddpStatus::kNotPositiveDefinite) solve_ = ENGRAM_NOT_POS_DEF;
    if (direction != FddpStatus::kIterationLimit) return false;
    const bool late = options_.budget_us > 0.0 && now() - begin + slowest > options_.budget_us;
    if (late && i < iterations) solve_ = ENGRAM_DEADLINE;
    const bool done = stats_.iterations > 0 && work_.feasible && stats_.last().stop < kStop;
    if (i >= iterations || late || done) return true;
    relinearize = fddp_step(horizon_, solver_, work_, trial_.s, stats_);
    if (!relinearize) {  // the same direction would fail again: only more regularization can help
      work_.reg = increased(work_.reg, solver_);
      if (work_.reg >= solver_.reg_max) return solve_ = ENGRAM_NOT_POS_DEF, false;
    }
    record_merit();
    slowest = std::max(slowest, now() - start);
  }
}

template <class M> engram_status Planner<M>::prepare(int64_t utime) {
  const double begin = now();
  begin_period();
  prepared_ = true;
  take_task(utime);
  const bool postponed = trial_is_ == Trial::kPostponed;
  if (!has_task_ || !watch_.any) {
    trial_is_ = Trial::kNone;
    return ENGRAM_NO_TASK;
  }
  if (jumped_) jump_utime_ = utime;
  const bool fresh = jumped_ || plan_.n == 0 || postponed;  // whole knots from utime on
  predict(utime, horizon_.x0);
  pose_problem(utime, fresh ? utime : plan_.utime[1]);
  const int n = collect();
  const Candidate<P>& winner = candidates_[choose(n)];
  cycle_.winner = winner.kind;
  const bool resumed = winner.kind == ENGRAM_CANDIDATE_SHIFTED && !jumped_;  // the solve of the last period goes on
  const double reg = work_.reg;
  trial_is_ = Trial::kNone;
  if (!std::isfinite(winner.merit)) return solve_ = ENGRAM_NOT_FINITE;
  std::memcpy(trial_.s.x, winner.x, sizeof(trial_.s.x));
  std::memcpy(trial_.s.u, winner.u, sizeof(trial_.s.u));
  if (jumped_) {
    jump_ = engram_jump{};
    jump_.jump = task_.jump;
    jump_.utime = utime;
    jump_.winner = winner.kind;
    jump_.merit[0] = winner.merit;
    std::memcpy(jump_.x0, horizon_.x0, sizeof(horizon_.x0));
    std::memcpy(jump_.task, task_.value, sizeof(task_.value));
  }
  const bool waiting = fresh || plan_jump_ != task_.jump;  // the robot has no plan yet for this jump
  fddp_start(solver_, work_, stats_);
  if (resumed) work_.reg = reg;
  if (iterate(begin, waiting ? options_.iterations_jump : options_.iterations)) trial_is_ = Trial::kReady;
  jumped_ = false;
  cycle_.total_us = now() - begin;
  return solve_;
}

// Path of the hand and smallest clearance of trial_, at the knots and half-way between them.
template <class M> void Planner<M>::look_along_trial() {
  cycle_.npath = N + 1;
  cycle_.clearance = HUGE_VAL;
  for (int first = 0; first <= 2 * N; first += kLanes) {
    Pack q[nq], p[3];
    for (int l = 0; l < kLanes; ++l) {
      const int half = std::min(first + l, 2 * N), k = half / 2;
      double x[nx];
      if (half % 2 == 0) std::memcpy(x, trial_.s.x[k], sizeof(x));
      else plan_state(trial_, (trial_.utime[k] + trial_.utime[k + 1]) / 2, x);
      for (int i = 0; i < nq; ++i) q[i].l[l] = x[i];
    }
    const Pack clearance = M::template clearance<Pack>(q);
    M::template hand<Pack>(q, p);
    for (int l = 0; l < kLanes && first + l <= 2 * N; ++l) {
      cycle_.clearance = std::min(cycle_.clearance, clearance.l[l]);
      if ((first + l) % 2) continue;
      for (int i = 0; i < 3; ++i) cycle_.path[(first + l) / 2][i] = p[i].l[l];
    }
  }
}

// May trial_ be executed? The status says what stands against it.
template <class M> engram_status Planner<M>::judge(bool accepted) {
  cycle_.cost = trial_.s.cost;
  cycle_.gap = open_gap();
  if (!std::isfinite(cycle_.cost) || !all_finite(trial_.s.x[0], (N + 1) * nx) || !all_finite(trial_.s.u[0], N * P::nu) ||
      !all_finite(trial_.s.K[0][0], N * P::nu * P::Layout::nxp)) {
    return ENGRAM_NOT_FINITE;
  }
  look_along_trial();
  const double here = M::template clearance<double>(trial_.s.x[0]);  // a robot already too near may still leave
  if (!(cycle_.clearance >= std::min(options_.clearance_min, here - 1e-3))) return ENGRAM_COLLISION;
  // gap 0 lies between the measured state and the first knot: the gains answer for it
  if (!(open_gap(1, kNearKnots) <= kLargestNearGap && open_gap(1) <= kLargestGap)) return ENGRAM_OPEN_GAPS;
  if (solve_ == ENGRAM_DEADLINE) return ENGRAM_DEADLINE;
  if (!accepted) return ENGRAM_NO_DESCENT;
  return stats_.last().stop < kStop ? ENGRAM_CONVERGED : ENGRAM_ITERATING;
}

// What the last step left of the gaps of knots first to last, L1.
template <class M> double Planner<M>::open_gap(int first, int last) const {
  double sum = 0.0;
  for (int k = first; k <= last; ++k)
    for (double f : work_.f[k]) sum += std::fabs(f);
  return (1.0 - (stats_.iterations ? stats_.last().step_length : 0.0)) * sum;
}

template <class M> void Planner<M>::drop_plan() {
  plan_.n = 0;
  fast_.slot().n = 0;
  fast_.publish();
}

template <class M> engram_status Planner<M>::finish(engram_status status, engram_rung rung, double begin) {
  cycle_.seq = ++seq_;
  cycle_.jump = has_task_ ? task_.jump : 0;
  cycle_.status = status;
  cycle_.rung = std::max(rung, fast_.take_rung());
  cycle_.iterations = stats_.iterations;
  cycle_.linearize_us = stats_.us[kLinearize];
  cycle_.backward_us = stats_.us[kBackward];
  cycle_.rollout_us = stats_.us[kRollout];
  cycle_.total_us += now() - begin;
  fast_.alive(cycle_.utime, status);
  finished_ = cycle_;
  return status;
}

template <class M> engram_status Planner<M>::feedback(int64_t utime, const double* q, const double* v) {
  const double begin = now();
  if (!prepared_) begin_period();
  prepared_ = false;
  cycle_.utime = utime;
  const bool before = watch_.any && utime < watch_.utime;
  const int64_t blind = watch_.any ? utime - watch_.utime : 0;
  const bool good = !before && watch_.take(utime, q, v);
  if (before || blind > options_.state_gap_us) {  // the robot may be anywhere
    drop_plan();
    trial_is_ = Trial::kNone;
    if (before) watch_.any = false;
    return finish(ENGRAM_STALE_STATE, ENGRAM_RUNG_HOLD, begin);
  }
  const bool has_plan = plan_.n > 0 && utime < plan_.utime[N];
  const engram_rung fallback = has_plan ? ENGRAM_RUNG_SHIFTED : ENGRAM_RUNG_HOLD;
  if (!has_task_) return finish(good ? ENGRAM_NO_TASK : ENGRAM_BAD_STATE, ENGRAM_RUNG_HOLD, begin);
  if (trial_is_ != Trial::kReady) {
    if (!has_plan) drop_plan();
    return finish(solve_ == ENGRAM_ITERATING ? ENGRAM_DEADLINE : solve_, fallback, begin);
  }
  const int64_t slip = utime - trial_.utime[0];
  trial_is_ = Trial::kNone;
  if (slip > M::kTickUs / 2 || slip < -M::kTickUs / 2) return finish(ENGRAM_DEADLINE, fallback, begin);

  trial_.utime[0] = utime;
  M::knot(task_.target, trial_.dt(0), 1e-6 * static_cast<double>(utime - jump_utime_), horizon_.knot[0]);
  if (good) std::memcpy(horizon_.x0, watch_.x, sizeof(horizon_.x0));
  const bool accepted = fddp_feedback(horizon_, solver_, work_, trial_.s, stats_);
  const engram_status status = judge(accepted);
  switch (status) {
    case ENGRAM_NOT_FINITE: break;
    case ENGRAM_COLLISION:
    case ENGRAM_OPEN_GAPS: trial_is_ = Trial::kPostponed; break;
    default:
      plan_ = trial_;
      plan_jump_ = task_.jump;
      fast_.slot() = plan_;
      fast_.publish();
      return finish(good ? status : ENGRAM_BAD_STATE, ENGRAM_RUNG_PLAN, begin);
  }
  if (!has_plan) drop_plan();
  return finish(status, fallback, begin);
}

}  // namespace engram
#endif  // CONTROLLER_LOOP_LOOP_PLANNER_H_
