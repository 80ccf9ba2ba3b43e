// The iteration: linearize, sweep, roll out, until the expected improvement is small or a budget is spent.
//
// In the control loop the same iteration is cut in two at the arrival of the state: fddp_prepare (linearize, sweep) before it,
// fddp_feedback (roll out from the measured state) after it.
#ifndef CONTROLLER_FDDP_FDDP_SOLVE_H_
#define CONTROLLER_FDDP_FDDP_SOLVE_H_

#include "controller/fddp/fddp_backward.h"
#include "controller/fddp/fddp_linearize.h"
#include "controller/fddp/fddp_rollout.h"

#include <cmath>

namespace engram {

// Adds the time since its construction to a phase; does nothing without a clock.
class FddpTimer {
 public:
  FddpTimer(const FddpOpts& opts, double& sum) : opts_(opts), sum_(sum), start_(opts.now()) {}
  ~FddpTimer() { sum_ += opts_.now() - start_; }
  FddpTimer(const FddpTimer&) = delete;
  FddpTimer& operator=(const FddpTimer&) = delete;

 private:
  const FddpOpts& opts_;
  double& sum_;
  double start_;
};

inline double increased(double reg, const FddpOpts& o) { return std::fmin(reg * o.reg_factor, o.reg_max); }
inline double decreased(double reg, const FddpOpts& o) { return std::fmax(reg / o.reg_factor, o.reg_min); }

// Starts a solve from the guess in s (states and controls; gaps allowed).
template <class P, int N> void fddp_start(const FddpOpts& opts, FddpWork<P, N>& w, FddpStats& stats) {
  w.feasible = w.was_feasible = false;
  w.reg = opts.reg_init;
  stats = FddpStats{};
}

// Linearizes if asked to, and sweeps with growing regularization until a descent direction is found.
template <class P, int N>
FddpStatus fddp_direction(const Horizon<P, N>& h, const FddpOpts& opts, bool relinearize, FddpWork<P, N>& w, FddpSolution<P, N>& s,
                          FddpStats& stats) {
  if (relinearize) {
    FddpTimer timer(opts, stats.us[kLinearize]);
    if (!fddp_linearize(h, s, w, opts.threads)) return FddpStatus::kNotFinite;
    if (!w.feasible && w.largest_gap < opts.gap_zero) w.feasible = true;
    s.cost = w.cost;
  }
  FddpTimer timer(opts, stats.us[kBackward]);
  while (!fddp_backward(h, opts, w, s)) {  // at most log(reg_max / reg_min) / log(reg_factor) times
    w.reg = increased(w.reg, opts);
    if (w.reg >= opts.reg_max) return FddpStatus::kNotPositiveDefinite;
  }
  return FddpStatus::kIterationLimit;
}

// Line search along the direction, kLanes step lengths at a time. True if a step was accepted; s is then the new trajectory.
template <class P, int N>
bool fddp_step(const Horizon<P, N>& h, const FddpOpts& opts, FddpWork<P, N>& w, FddpSolution<P, N>& s, FddpStats& stats) {
  FddpTimer timer(opts, stats.us[kRollout]);
  FddpIteration log;
  log.gap = w.gap;
  log.gradient = w.gradient;
  bool accepted = false;
  double alpha = 1.0, tried = 1.0;
  for (int first = 0; first < opts.step_lengths && !accepted; first += kLanes) {
    Pack alphas;
    for (int i = 0; i < kLanes; ++i, alpha *= 0.5) alphas.l[i] = alpha;
    Pack dv;
    const Pack cost = fddp_rollout(h, opts, s, alphas, w, dv);
    for (int i = 0; i < kLanes && first + i < opts.step_lengths && !accepted; ++i) {
      tried = alphas.l[i];
      if (!std::isfinite(cost.l[i])) continue;
      const double shift = w.feasible ? 0.0 : dv.l[i];
      const double d1 = w.dg + shift, d2 = w.dq - 2.0 * shift;
      const double gain = w.cost - cost.l[i], expected = tried * (d1 + 0.5 * tried * d2);
      log.stop = std::fabs(d1 + 0.5 * d2);
      accepted = expected >= 0.0 ? std::fabs(d1) < opts.gradient_zero || gain > opts.accept * expected
                                 : gain > opts.accept_negative * expected;  // gaps close at a bounded price
      if (accepted) {
        fddp_accept(h, w, i, s);
        s.cost = cost.l[i];
        w.was_feasible = w.feasible;
        w.feasible = w.feasible || tried == 1.0;
        log.step_length = tried;
      }
    }
  }
  if (tried > opts.step_decrease_reg) w.reg = decreased(w.reg, opts);
  if (tried <= opts.step_increase_reg) w.reg = increased(w.reg, opts);
  log.cost = s.cost;
  log.reg = w.reg;
  if (stats.iterations < FddpStats::kLog) stats.log[stats.iterations] = log;
  ++stats.iterations;
  stats.feasible = w.feasible;
  return accepted;
}

// Iterates from the guess in s to convergence or a budget. The result is in s; stats.status says how it ended.
template <class P, int N>
FddpStatus fddp_solve(const Horizon<P, N>& h, const FddpOpts& opts, FddpWork<P, N>& w, FddpSolution<P, N>& s, FddpStats& stats) {
  const double start = opts.now();
  double slowest = 0.0;  // iteration so far, us
  fddp_start(opts, w, stats);
  if (fddp_check(h).text) return stats.status = FddpStatus::kBadHorizon;
  bool relinearize = true;
  for (int i = 0; i < opts.iterations; ++i) {
    const double begin = opts.now();
    if (opts.budget_us > 0.0 && begin - start + slowest > opts.budget_us) return stats.status = FddpStatus::kDeadline;
    const FddpStatus direction = fddp_direction(h, opts, relinearize, w, s, stats);
    if (direction != FddpStatus::kIterationLimit) return stats.status = direction;
    const bool closed = w.feasible;  // before the step
    relinearize = fddp_step(h, opts, w, s, stats);
    if (w.reg >= opts.reg_max) return stats.status = FddpStatus::kNotPositiveDefinite;
    const FddpIteration& last = stats.last();
    if (opts.stop_gradient > 0.0 ? closed && last.gradient < opts.stop_gradient : w.feasible && last.stop < opts.stop)
      return stats.status = FddpStatus::kConverged;
    slowest = std::fmax(slowest, opts.now() - begin);
  }
  return stats.status = FddpStatus::kIterationLimit;
}

// Before the state: direction and gains at the trajectory in s. kIterationLimit means ready; after any other status nothing is to be
// rolled out. kBadHorizon: fddp_check(h).text says why.
template <class P, int N>
FddpStatus fddp_prepare(const Horizon<P, N>& h, const FddpOpts& opts, FddpWork<P, N>& w, FddpSolution<P, N>& s, FddpStats& stats) {
  fddp_start(opts, w, stats);
  if (fddp_check(h).text) return stats.status = FddpStatus::kBadHorizon;
  return stats.status = fddp_direction(h, opts, true, w, s, stats);
}

// After the state: h.x0 is now the measured one; rolls out along the prepared direction. True if s was improved.
template <class P, int N>
bool fddp_feedback(const Horizon<P, N>& h, const FddpOpts& opts, FddpWork<P, N>& w, FddpSolution<P, N>& s, FddpStats& stats) {
  for (Real f : w.f[0]) w.gap -= std::fabs(f);
  P::difference(s.x[0], h.x0, w.f[0]);
  for (Real f : w.f[0]) w.gap += std::fabs(f);
  w.feasible = false;
  std::memcpy(w.Vx, w.Vx0, sizeof(w.Vx));
  w.dg = w.dg0;
  w.dq = w.dq0;
  close_gap(0, w);
  return fddp_step(h, opts, w, s, stats);
}

}  // namespace engram
#endif  // CONTROLLER_FDDP_FDDP_SOLVE_H_
