// The planner of tasks that never end: a horizon that recedes, one trajectory, one iteration per tick by default.
//
//   prepare   predict the state at the next tick; pose the problem anew at the knots' times; shift the trajectory (knots sit at
//             absolute times, so that only its first state is new, and a knot is appended at grid points); iterate; sweep once more
//   feedback  roll out from the measured state; check the plan (finite, gaps, speeds); hand it to the fast side
//
// Whatever moves with time (references, contact phases) is the model's business. A model M of this planner has
//
//   using P, R, Target, Hold, Task (with its digest); static constexpr N, ntask, kStepUs, kTickUs, kIterations, kLargestNearGap, kLargestGap
//   static bool target(const double* value, Target&), known(const double* value)      as for the reach planner
//   void begin(int64_t utime, const double* x)                        the robot starts here, with knots at utime + m kStepUs
//   void take(int64_t utime, const Target&)                           from utime on this is the task
//   void pose(const int64_t (&utime)[N + 1], const double* x0, Horizon<P, N>&)        all knots and phases for these knot times,
//                                                                     x0: the state expected at utime[0]
//   void extend(const Horizon<P, N>&, int k, const double* x, double* u, double* x_next)   a guess of knot k from state x on
//   static void path(const double* x, double p[3])                    the point of the robot that is reported along the plan [m]
//   void tell(engram_legs&) const                                     where legs are asked to be; nothing for a robot without
//
// It need not have contacts, nor phases. A model whose M::Memory `kRemembers` has a rival to the shifted plan at every tick (loop_rival.h);
// one whose memory `kContinues`, another guess of the knots that enter the horizon (loop_continue.h).
#ifndef CONTROLLER_LOOP_LOOP_RECEDING_H_
#define CONTROLLER_LOOP_LOOP_RECEDING_H_

#include "controller/loop/loop_continue.h"
#include "controller/loop/loop_core.h"
#include "controller/loop/loop_rival.h"

namespace engram {

template <class M> class RecedingPlanner : public PlannerCore<M, RecedingPlanner<M>> {
 public:
  using Core = PlannerCore<M, RecedingPlanner<M>>;
  using typename Core::Fast, typename Core::P;
  using Core::N, Core::nx;

  RecedingPlanner(const engram_options& options, Fast& fast) : Core(options, fast), rival_(options) {}

  engram_status prepare(int64_t utime);
  engram_status roll(int64_t utime);

 private:
  using typename Core::Trial;
  using Core::cycle_, Core::ending_, Core::has_task_, Core::jumped_, Core::options_, Core::plan_, Core::prepared_, Core::seq_,
      Core::solve_, Core::task_, Core::trial_, Core::watch_;

  bool iterate(const Plan<P, N>& before, bool fresh, Deadline& deadline);
  void challenge(Deadline& deadline);

  M model_;
  int64_t origin_ = 0;  // us, whole knots end at origin_ + m kStepUs
  int64_t taken_ = -1;  // us, time of the task that the model has
  int64_t utime_[N + 1];
  Rival<M> rival_;
  Continuation<M> continuation_;

 protected:
  Seed<P, N> seed_;  // the shifted plan, on this period's knot times
};

// The trajectory before, on the new knot times, iterated and swept; a fresh one stands still. False if the solver failed.
template <class M> bool RecedingPlanner<M>::iterate(const Plan<P, N>& before, bool fresh, Deadline& deadline) {
  const double* const x0 = solve_.horizon.x0;
  const auto extend = [&](int k, const double* x, double* u, double* x_next) { model_.extend(solve_.horizon, k, x, u, x_next); };
  const Seed<P, N>* seed = &seed_;
  if (fresh) {
    std::memcpy(seed_.x[0], x0, sizeof(seed_.x[0]));
    for (int k = 0; k < N; ++k) extend(k, seed_.x[k], seed_.u[k], seed_.x[k + 1]);
  } else {
    resample(before, utime_, x0, seed_, extend);
    if constexpr (M::Memory::kContinues) {
      int kept = N;
      while (kept > 0 && utime_[kept] > before.utime[before.n]) --kept;
      if (options_.memory == ENGRAM_MODE_MEMORY && task_.known && kept < N)
        seed = &continuation_.better(model_, solve_.horizon, kept, seed_, deadline, extend, cycle_);
    }
  }
  std::memcpy(solve_.plan.utime, utime_, sizeof(utime_));
  solve_.plan.n = N;
  solve_.start(seed->x, seed->u, fresh ? 0.0 : solve_.reg());
  const int iterations = fresh ? options_.iterations_jump : options_.iterations;
  return solve_.improve(iterations - 1, deadline, [] {}) && solve_.ready();
}

// What the memory proposes takes the place of the shifted plan if it costs less after iterations of its own.
template <class M> void RecedingPlanner<M>::challenge(Deadline& deadline) {
  const double begin = deadline.now();
  if (jumped_) rival_.forget();
  const bool asked = rival_.ask(task_.target, seq_, solve_);
  const double answered = deadline.now();
  cycle_.asked_us[ENGRAM_CANDIDATE_KNN] = answered - begin;
  cycle_.query_us += answered - begin;
  if (!asked) return;
  const bool better = rival_.better(solve_, deadline, [&](int k, const double* x, double* u, double* x_next) {
    model_.extend(solve_.horizon, k, x, u, x_next);
  });
  cycle_.candidates_us = deadline.now() - answered;
  cycle_.guess[1] = ENGRAM_CANDIDATE_KNN;
  cycle_.merit[0] = rival_.cost_of_shifted();
  cycle_.merit[1] = rival_.cost();
  cycle_.nguess = 2;
  if (!better) return;
  cycle_.winner = ENGRAM_CANDIDATE_KNN;
  rival_.take_over(solve_);
}

template <class M> engram_status RecedingPlanner<M>::prepare(int64_t utime) {
  Deadline deadline(options_);
  this->begin_period();
  prepared_ = true;
  this->take_task(utime);
  const bool postponed = trial_ == Trial::kPostponed;
  trial_ = Trial::kNone;
  if (!has_task_ || !watch_.any) return ENGRAM_NO_TASK;
  const bool fresh = plan_.n == 0 && !postponed;
  predict(plan_, watch_, utime, solve_.horizon.x0);
  if (fresh) {
    origin_ = utime;
    taken_ = -1;
    model_.begin(utime, solve_.horizon.x0);
  }
  if (taken_ != task_.utime) {
    taken_ = task_.utime;
    model_.take(task_.utime, task_.target);
  }
  const double posing = deadline.now();
  knot_times<N>(utime, origin_, M::kStepUs, utime_);
  solve_.horizon.n = N;
  model_.pose(utime_, solve_.horizon.x0, solve_.horizon);
  model_.tell(cycle_.legs);
  cycle_.query_us = deadline.now() - posing;
  cycle_.nguess = 1;
  const bool cold = fresh || (options_.memory == ENGRAM_MODE_COLD && jumped_);
  cycle_.winner = cycle_.guess[0] = cold ? ENGRAM_CANDIDATE_COLD : ENGRAM_CANDIDATE_SHIFTED;
  if (iterate(postponed ? solve_.plan : plan_, cold, deadline)) {
    if (cycle_.nguess == 1) cycle_.merit[0] = solve_.merit();
    if constexpr (M::Memory::kRemembers) {
      if (options_.memory == ENGRAM_MODE_MEMORY && task_.known && !fresh) challenge(deadline);
    }
    trial_ = Trial::kReady;
    if (deadline.late()) ending_ = ENGRAM_DEADLINE;
  } else {
    ending_ = solve_.failure();
  }
  jumped_ = false;
  cycle_.total_us = deadline.spent();
  return ending_;
}

template <class M> engram_status RecedingPlanner<M>::roll(int64_t utime) {
  solve_.plan.utime[0] = utime;
  solve_.horizon.knot[0].dt = solve_.plan.dt(0);
  const bool accepted = solve_.feedback();
  cycle_.cost = solve_.plan.s.cost;
  cycle_.gap = solve_.open_gap(0, N);
  if (!solve_.finite()) return ENGRAM_NOT_FINITE;
  cycle_.npath = N + 1;
  for (int k = 0; k <= N; ++k) M::path(solve_.plan.s.x[k], cycle_.path[k]);
  return this->judge(accepted);
}

}  // namespace engram
#endif  // CONTROLLER_LOOP_LOOP_RECEDING_H_
