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

#include "controller/loop/loop_core.h"
#include "controller/loop/loop_guesses.h"

namespace engram {

// Share of what counts as success, beyond which the plan under way misses its target. The hand comes to rest further off than the
// plan ends, where the weight of the pose is larger than on the way.
inline constexpr double kAstray = 0.5;
inline constexpr int kRivals = 5;       // guesses that are tried in turn while the plan does not end at the target

template <class M> class Planner : public PlannerCore<M, Planner<M>> {
 public:
  using Core = PlannerCore<M, Planner<M>>;
  using typename Core::Fast, typename Core::P;
  using Core::N, Core::nq, Core::nx;

  Planner(const engram_options& options, Fast& fast) : Core(options, fast) {}

  engram_status prepare(int64_t utime);
  engram_status roll(int64_t utime);
  int choose_goal(const double* q, const double* v, const double* goals, int n, double* merit);

 private:
  using typename Core::Trial;
  using Core::cycle_, Core::ending_, Core::has_task_, Core::jump_, Core::jumped_, Core::options_, Core::plan_, Core::plan_jump_,
      Core::prepared_, Core::seq_, Core::solve_, Core::task_, Core::trial_, Core::watch_;
  // The best of several starts.
  struct Result {
    Seed<P, N> seed;
    double score, reg;
  };

  void collect(bool postponed, bool stuck, const Deadline& deadline);
  bool search(bool waiting, bool astray, Deadline& deadline);
  double score(double nearest) const;
  double nearest_allowed() const;
  void record_start(const Candidate<P>& guess);
  void record_merit(int iteration);

  int64_t jump_utime_ = 0;  // us, first knot of the jump's first problem
  Guesses<M> guesses_;
  Result best_;
};

// The guesses for the posed problem, and their merits. While the robot is `stuck`, every period has one line to somewhere else.
template <class M> void Planner<M>::collect(bool postponed, bool stuck, const Deadline& deadline) {
  const double begin = deadline.now();
  const double* const x0 = solve_.horizon.x0;
  const bool cold = options_.memory == ENGRAM_MODE_COLD && jumped_;
  if (!cold && plan_.n > 0) guesses_.add_shifted(plan_, solve_.plan.utime, x0);
  if (!cold && !jumped_ && postponed) guesses_.add_postponed(solve_.plan, x0);
  if (guesses_.n == 0) guesses_.add_standing_still(x0);
  if (options_.memory == ENGRAM_MODE_MEMORY || options_.memory == ENGRAM_MODE_LINE) {
    const bool remember = options_.memory == ENGRAM_MODE_MEMORY && task_.known;
    guesses_.ask_memory(task_.target, {remember, stuck ? seq_ + 1 : 0, options_.clock, cycle_.asked_us}, x0, solve_.plan.utime);
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
// at the target (`astray`), from one such other in turn. Readies the best result. False if all solves failed.
template <class M> bool Planner<M>::search(bool waiting, bool astray, Deadline& deadline) {
  const int starts = waiting ? options_.starts : astray ? 2 : 1;
  const double resumed_reg = solve_.reg(), nearest = nearest_allowed();
  best_.score = HUGE_VAL;
  for (int s = 0; s < starts && (s == 0 || !deadline.late()); ++s) {
    const int rank = jumped_ ? 0 : static_cast<int>(seq_ % kRivals);
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
  this->begin_period();
  guesses_.clear();
  prepared_ = true;
  this->take_task(utime);
  const bool postponed = trial_ == Trial::kPostponed;
  trial_ = Trial::kNone;
  if (!has_task_ || !watch_.any) return ENGRAM_NO_TASK;
  if (jumped_) jump_utime_ = utime;
  const bool fresh = jumped_ || plan_.n == 0 || postponed;  // whole knots from utime on
  predict(plan_, watch_, utime, solve_.horizon.x0);
  solve_.pose(task_.target, jump_utime_, utime, fresh ? utime : plan_.utime[1]);
  const bool waiting = fresh || plan_jump_ != task_.jump;
  const bool astray = !waiting && !M::arrived(task_.target, plan_.s.x[N], kAstray);
  collect(postponed, (waiting && !jumped_) || astray, deadline);
  if (search(waiting, astray, deadline)) {
    trial_ = Trial::kReady;
    if (deadline.late()) ending_ = ENGRAM_DEADLINE;
  }
  jumped_ = false;
  cycle_.total_us = deadline.spent();
  return ending_;
}

// The goal (n, ntask) with the cheapest guess from q, v. Scratch is what the next period fills anew: not while one is prepared.
template <class M> int Planner<M>::choose_goal(const double* q, const double* v, const double* goals, int n, double* merit) {
  double x0[nx];
  std::memcpy(x0, q, sizeof(double) * nq);
  std::memcpy(x0 + nq, v, sizeof(double) * (nx - nq));
  const bool able = !prepared_ && all_finite(x0, nx);
  int best = -1;
  for (int g = 0; g < n; ++g) {
    const double* const value = goals + g * M::ntask;
    typename M::Target target;
    const bool known = able && all_finite(value, M::ntask) && M::target(value, target) && M::known(value);
    merit[g] = known ? guesses_.merit_of(target, x0, solve_.horizon) : HUGE_VAL;
    if (merit[g] < (best < 0 ? HUGE_VAL : merit[best])) best = g;
  }
  return best;
}

// May the new plan be executed? The status says what stands against it.
template <class M> engram_status Planner<M>::roll(int64_t utime) {
  solve_.repose(task_.target, jump_utime_, utime);
  const bool accepted = solve_.feedback();
  cycle_.cost = solve_.plan.s.cost;
  cycle_.gap = solve_.open_gap(0, N);
  if (!solve_.finite()) return ENGRAM_NOT_FINITE;
  cycle_.npath = N + 1;
  cycle_.clearance = solve_.look_along(cycle_.path);
  if (!(cycle_.clearance >= nearest_allowed())) return ENGRAM_COLLISION;
  return this->judge(accepted);
}

}  // namespace engram
#endif  // CONTROLLER_LOOP_LOOP_PLANNER_H_
