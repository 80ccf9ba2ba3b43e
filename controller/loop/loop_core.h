// What every planner does alike: the task and its time, the last good state, the plan that is executed, and the feedback half of a
// period with its fall-backs. How a problem is posed and solved is the business of a planner `Self` on top of it:
//
//   engram_status roll(int64_t utime)   rolls out the prepared trajectory from solve_.horizon.x0, measured at utime, and judges it
//
// A plan that passes is `plan_`: it is executed, and its shift is a guess of the next period. A new plan that does not pass is not
// lost if the solver is only not done: it is postponed. A solve that failed (not finite, not positive definite) seeds nothing.
#ifndef CONTROLLER_LOOP_LOOP_CORE_H_
#define CONTROLLER_LOOP_LOOP_CORE_H_

#include "controller/loop/loop_fast.h"
#include "controller/loop/loop_solve.h"

namespace engram {

// A plan is executed although its gaps (L1, rad and rad/s) are not quite closed: the next period closes them before they are reached,
// if they are small (M::kLargestGap), and smaller still (M::kLargestNearGap) in the near future.
// Nor may it be faster in the near future than M::kLargestSpeed times a velocity limit; a robot that is faster already may brake.
inline constexpr int kNearKnots = 10;

template <class M, class Self> class PlannerCore {
 public:
  using P = typename M::P;
  using Fast = FastLoop<P, M::N, typename M::Hold>;
  static constexpr int N = M::N, nx = P::nx, nq = P::nq, nv = P::nv;

  PlannerCore(const engram_options& options, Fast& fast) : options_(options), fast_(fast), solve_(options) {}

  engram_status set_task(int64_t utime, int32_t jump, const double* value, int n);
  engram_status feedback(int64_t utime, const double* q, const double* v);

  const engram_cycle& cycle() const { return finished_; }
  const engram_jump& jump() const { return jump_; }
  const Plan<P, N>& plan() const { return plan_; }

 protected:
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

  void begin_period();
  void take_task(int64_t utime);
  engram_status judge(bool accepted) const;
  engram_status finish(engram_status status, engram_rung rung, const Deadline& deadline);
  void drop_plan();

  const engram_options& options_;
  Fast& fast_;

  bool has_task_ = false, task_pending_ = false;
  Task task_, pending_;
  bool jumped_ = false;    // the next problem is the first of a jump
  int32_t plan_jump_ = 0;  // jump that `plan_` serves

  StateWatch<P> watch_;
  Plan<P, N> plan_;  // executed; n = 0: none
  Solve<M> solve_;
  Trial trial_ = Trial::kNone;
  engram_status ending_ = ENGRAM_ITERATING;  // of the iterations before the feedback

  bool prepared_ = false;  // cycle_ belongs to the period under way
  engram_cycle cycle_ = {}, finished_ = {};
  engram_jump jump_ = {};
  int64_t seq_ = 0;
};

template <class M, class Self> engram_status PlannerCore<M, Self>::set_task(int64_t utime, int32_t jump, const double* value, int n) {
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

template <class M, class Self> void PlannerCore<M, Self>::begin_period() {
  cycle_ = engram_cycle{};
  solve_.clear();
  ending_ = ENGRAM_ITERATING;
}

// The pending task becomes the task once its time has come.
template <class M, class Self> void PlannerCore<M, Self>::take_task(int64_t utime) {
  if (!task_pending_ || pending_.utime > utime) return;
  jumped_ = jumped_ || !has_task_ || pending_.jump != task_.jump;
  task_ = pending_;
  has_task_ = true;
  task_pending_ = false;
}

// May the trajectory be executed, whatever it runs into? The status says what stands against it, or how the solver ended.
template <class M, class Self> engram_status PlannerCore<M, Self>::judge(bool accepted) const {
  constexpr int near = kNearKnots < N ? kNearKnots : N;
  // gap 0 lies between the measured state and the first knot: the gains answer for it
  if (!(solve_.open_gap(1, near) <= M::kLargestNearGap && solve_.open_gap(1, N) <= M::kLargestGap)) return ENGRAM_OPEN_GAPS;
  if (!(solve_.speed(1, near) <= std::max(M::kLargestSpeed, solve_.speed(0, 0)))) return ENGRAM_TOO_FAST;
  if (ending_ == ENGRAM_DEADLINE) return ENGRAM_DEADLINE;
  if (!accepted) return ENGRAM_NO_DESCENT;
  return solve_.stop() < kStop ? ENGRAM_CONVERGED : ENGRAM_ITERATING;
}

template <class M, class Self> void PlannerCore<M, Self>::drop_plan() {
  plan_.n = 0;
  fast_.slot().n = 0;
  fast_.publish();
}

template <class M, class Self>
engram_status PlannerCore<M, Self>::finish(engram_status status, engram_rung rung, const Deadline& deadline) {
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

template <class M, class Self> engram_status PlannerCore<M, Self>::feedback(int64_t utime, const double* q, const double* v) {
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
  const engram_status status = static_cast<Self*>(this)->roll(utime);
  if (status == ENGRAM_COLLISION || status == ENGRAM_OPEN_GAPS || status == ENGRAM_TOO_FAST) trial_ = Trial::kPostponed;
  if (status == ENGRAM_NOT_FINITE || trial_ == Trial::kPostponed) return finish(status, fallback, deadline);
  plan_ = solve_.plan;
  plan_jump_ = task_.jump;
  static_cast<Plan<P, N>&>(fast_.slot()) = plan_;
  if (options_.delay_us > 0) solve_.copy_models(fast_.slot().D);
  fast_.publish();
  return finish(good ? status : ENGRAM_BAD_STATE, ENGRAM_RUNG_PLAN, deadline);
}

}  // namespace engram
#endif  // CONTROLLER_LOOP_LOOP_CORE_H_
