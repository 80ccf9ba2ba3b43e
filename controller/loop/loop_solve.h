// One trajectory under iteration: its problem, the FDDP steps taken on it, and what is left of its gaps.
#ifndef CONTROLLER_LOOP_LOOP_SOLVE_H_
#define CONTROLLER_LOOP_LOOP_SOLVE_H_

#include "controller/engram.h"
#include "controller/fddp/fddp_solve.h"
#include "controller/loop/loop_merit.h"
#include "controller/loop/loop_plan.h"

#include <algorithm>
#include <type_traits>

namespace engram {

inline constexpr double kStop = 1e-4;  // expected improvement below which a plan counts as converged

// The time budget of one period. Without a budget it never ends, without a clock all times are 0.
class Deadline {
 public:
  explicit Deadline(const engram_options& options) : options_(options), begin_(now()) {}
  double now() const { return options_.clock ? options_.clock() : 0.0; }
  double spent() const { return now() - begin_; }
  // True if another iteration as long as the slowest so far would end late.
  bool late() const { return options_.budget_us > 0.0 && spent() + slowest_ > options_.budget_us; }
  void took(double us) { slowest_ = std::max(slowest_, us); }

 private:
  const engram_options& options_;
  double begin_, slowest_ = 0.0;
};

// True for a model whose controls the solver keeps within their box.
template <class M, class = void> inline constexpr bool kBoxedControls = false;
template <class M> inline constexpr bool kBoxedControls<M, std::void_t<decltype(M::kBoxedControls)>> = M::kBoxedControls;

template <class M> class Solve {
 public:
  using P = typename M::P;
  static constexpr int N = M::N, nx = P::nx, nu = P::nu;

  explicit Solve(const engram_options& options) {
    opts_.step_lengths = options.line_search;
    opts_.now_us = options.clock;
    opts_.stop = kStop;
    opts_.box = kBoxedControls<M>;
  }

  Horizon<P, N> horizon;
  Plan<P, N> plan;  // the trajectory, its gains, its knot times
  FddpStats stats;  // of all iterations since clear()

  // A new period: no iterations yet.
  void clear() { stats = FddpStats{}; }

  // Poses the problem that starts at utime; ends of whole knots lie on phase + m kStepUs.
  void pose(const typename M::Target& target, int64_t jump_utime, int64_t utime, int64_t phase) {
    horizon.n = plan.n = N;
    knot_times<N>(utime, phase, M::kStepUs, plan.utime);
    for (int k = 0; k <= N; ++k) pose_knot(target, jump_utime, k);
  }

  // Begins at a guess, which becomes the trajectory. Regularization reg: that of the solve it continues, or 0 for a fresh one.
  void start(const double (*x)[nx], const double (*u)[nu], double reg) {
    std::memcpy(plan.s.x, x, sizeof(plan.s.x));
    std::memcpy(plan.s.u, u, sizeof(plan.s.u));
    work_.feasible = work_.was_feasible = false;
    work_.reg = reg > 0.0 ? reg : opts_.reg_init;
    step_ = 0.0;
    stop_ = HUGE_VAL;
    relinearize_ = true;
    failure_ = ENGRAM_ITERATING;
  }

  // What `other` is on the same horizon: trajectory, direction, gains. The iterations counted stay its own.
  void become(const Solve& other) {
    const FddpStats own = stats;
    *this = other;
    stats = own;
  }

  // Up to n whole iterations, the first one from a sweep that is done already if `swept`; `each()` is called after every one. False if the
  // solver failed: failure() says how.
  template <class F> bool improve(int n, Deadline& deadline, F each, bool swept = false) {
    for (int i = 0; i < n && !converged() && !deadline.late(); ++i) {
      const double begin = deadline.now();
      if (!swept && !ready()) return false;
      swept = false;
      relinearize_ = step();
      if (!relinearize_) {  // the same direction would fail again: only more regularization can help
        work_.reg = increased(work_.reg, opts_);
        if (work_.reg >= opts_.reg_max) return failure_ = ENGRAM_NOT_POS_DEF, false;
      }
      each();
      deadline.took(deadline.now() - begin);
    }
    return true;
  }

  // Direction and gains at the trajectory: the first half of an iteration. False if the solver failed.
  bool ready() {
    const FddpStatus status = fddp_direction(horizon, opts_, relinearize_, work_, plan.s, stats);
    if (status == FddpStatus::kNotFinite) failure_ = ENGRAM_NOT_FINITE;
    if (status == FddpStatus::kNotPositiveDefinite) failure_ = ENGRAM_NOT_POS_DEF;
    return status == FddpStatus::kIterationLimit;
  }

  // The posed problem, but that it starts at utime.
  void repose(const typename M::Target& target, int64_t jump_utime, int64_t utime) {
    plan.utime[0] = utime;
    pose_knot(target, jump_utime, 0);
  }
  // The second half, for the measured state horizon.x0. True if the trajectory was improved.
  bool feedback() {
    const bool accepted = fddp_feedback(horizon, opts_, work_, plan.s, stats);
    step_ = accepted ? stats.last().step_length : 0.0;
    stop_ = stats.last().stop;
    return accepted;
  }

  // D = d v' / d z of the first knots, where the trajectory was linearized.
  template <int n, int nz> void copy_models(Real (&D)[n][P::nv][nz]) const {
    for (int k = 0; k < n; ++k) std::memcpy(D[k], work_.model[k].D, sizeof(D[k]));
  }

  bool converged() const { return work_.feasible && stop_ < kStop; }
  double stop() const { return stop_; }  // expected improvement of the last direction
  double reg() const { return work_.reg; }
  engram_status failure() const { return failure_; }
  double merit() const { return plan.s.cost + kMeritWeight * open_gap(0, N); }

  // What the last step left of the gaps of knots first to last, L1.
  double open_gap(int first, int last) const {
    double sum = 0.0;
    for (int k = first; k <= last; ++k)
      for (double f : work_.f[k]) sum += std::fabs(f);
    return (1.0 - step_) * sum;
  }

  bool finite() const {
    return std::isfinite(plan.s.cost) && all_finite(plan.s.x[0], (N + 1) * nx) && all_finite(plan.s.u[0], N * nu) &&
           all_finite(plan.s.K[0][0], N * nu * P::Layout::nxp);
  }

  // Largest |v| of knots first to last, relative to its limit.
  double speed(int first, int last) const {
    double most = 0.0;
    for (int k = first; k <= last; ++k)
      for (int i = P::nv - P::nu; i < P::nv; ++i) most = std::max(most, std::fabs(plan.s.x[k][P::nq + i]) / P::R::v_max[i]);
    return most;
  }

  // Smallest clearance [m] along the trajectory, at the knots and half-way between them. `path`, if not null: the hand at the knots [m].
  double look_along(double (*path)[3]) const {
    constexpr int nq = P::nq;
    double least = HUGE_VAL;
    for (int first = 0; first <= 2 * N; first += kLanes) {
      Pack q[nq], p[3];
      for (int l = 0; l < kLanes; ++l) {
        const int half = std::min(first + l, 2 * N), k = half / 2;
        double x[nx];
        if (half % 2 == 0) std::memcpy(x, plan.s.x[k], sizeof(x));
        else plan_state(plan, (plan.utime[k] + plan.utime[k + 1]) / 2, x);
        for (int i = 0; i < nq; ++i) q[i].l[l] = x[i];
      }
      const Pack clearance = M::template clearance<Pack>(q);
      if (path != nullptr) M::template hand<Pack>(q, p);
      for (int l = 0; l < kLanes && first + l <= 2 * N; ++l) {
        least = std::min(least, clearance.l[l]);
        for (int i = 0; path != nullptr && (first + l) % 2 == 0 && i < 3; ++i) path[(first + l) / 2][i] = p[i].l[l];
      }
    }
    return least;
  }

 private:
  void pose_knot(const typename M::Target& target, int64_t jump_utime, int k) {
    M::knot(target, k < N ? plan.dt(k) : 0.0, 1e-6 * static_cast<double>(plan.utime[k] - jump_utime), horizon.knot[k]);
  }
  bool step() {
    const bool accepted = fddp_step(horizon, opts_, work_, plan.s, stats);
    step_ = accepted ? stats.last().step_length : 0.0;
    stop_ = stats.last().stop;
    return accepted;
  }

  FddpOpts opts_;
  FddpWork<P, N> work_;
  double step_ = 0.0, stop_ = HUGE_VAL;  // of the last iteration
  bool relinearize_ = true;
  engram_status failure_ = ENGRAM_ITERATING;
};

}  // namespace engram
#endif  // CONTROLLER_LOOP_LOOP_SOLVE_H_
