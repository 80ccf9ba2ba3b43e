// The fast side of the loop: torque from the newest plan at every state, and the ladder below it.
//
//   plan      u = u* - K (x (-) x*)              x*, u*, K of the plan at time t; where commands act late, when they do (loop_delay.h)
//   hold      keeps the posture at which holding began     (loop_hold.h: what that is depends on the kind of robot)
//   damping   takes out the motion
//   off       u = 0
//
// Then the clamp to the torque limits and to the largest rate. Runs on its own thread; one Exchange brings the plan.
#ifndef CONTROLLER_LOOP_LOOP_FAST_H_
#define CONTROLLER_LOOP_LOOP_FAST_H_

#include "controller/engram.h"
#include "controller/loop/loop_delay.h"
#include "controller/loop/loop_exchange.h"
#include "controller/loop/loop_hold.h"
#include "controller/loop/loop_plan.h"

#include <algorithm>

namespace engram {

inline constexpr double kLargestEntry = 1e3;  // a measured coordinate or velocity beyond it (rad, m, per s) is no measurement

// True if x could be a measurement.
template <class P> bool plausible(const double* q, const double* v) {
  for (int i = 0; i < P::nq; ++i)
    if (!(std::fabs(q[i]) < kLargestEntry)) return false;
  for (int i = 0; i < P::nv; ++i)
    if (!(std::fabs(v[i]) < kLargestEntry)) return false;
  return true;
}

// The clock of good states: how long ago the last one was.
template <class P> struct StateWatch {
  bool any = false;
  int64_t utime = 0;  // us, of the last good state
  double x[P::nx] = {};

  bool take(int64_t now, const double* q, const double* v) {
    if (!plausible<P>(q, v)) return false;
    any = true;
    utime = now;
    std::memcpy(x, q, sizeof(double) * P::nq);
    std::memcpy(x + P::nq, v, sizeof(double) * P::nv);
    return true;
  }
};

// The last measured state, carried along to utime by what the plan moves; at rest without a plan.
template <class P, int N> void predict(const Plan<P, N>& plan, const StateWatch<P>& watch, int64_t utime, double* x) {
  if (plan.n == 0) {
    std::memcpy(x, watch.x, sizeof(double) * P::nq);
    std::memset(x + P::nq, 0, sizeof(double) * P::nv);
    return;
  }
  double planned[P::nx], then[P::nx], dx[P::Layout::nxp];
  plan_state(plan, watch.utime, planned);
  plan_state(plan, utime, then);
  P::difference(planned, watch.x, dx);
  P::integrate(then, dx, x);
}

template <class P, int N, class Hold> class FastLoop {
 public:
  using R = typename P::R;
  static constexpr int nq = P::nq, nv = P::nv, nu = P::nu, base = P::kFreeBase ? 6 : 0;

  explicit FastLoop(const engram_options& options) : options_(options) {}

  // ---- planner thread ----
  // The slot of the next plan; n = 0 means hold.
  Order<P, N>& slot() { return exchange_.slot(); }
  void publish() { exchange_.publish(); }
  // The planner lives at time utime and stands at this rung and status.
  void alive(int64_t utime, engram_status status) {
    status_.store(status, std::memory_order_relaxed);
    alive_.store(utime, std::memory_order_release);
  }
  // Worst rung since the last call.
  engram_rung take_rung() { return static_cast<engram_rung>(worst_.exchange(ENGRAM_RUNG_PLAN, std::memory_order_relaxed)); }

  // ---- fast thread ----
  engram_status command(int64_t utime, const double* q, const double* v, double* tau);

 private:
  bool plan_law(int64_t utime, bool good, double* tau) const;
  bool hold_law(const double* v, double* tau);
  void limit(int64_t utime, double* tau);

  const engram_options& options_;
  Exchange<Order<P, N>> exchange_;
  std::atomic<int64_t> alive_{0};
  std::atomic<int32_t> status_{ENGRAM_NO_TASK};
  std::atomic<int32_t> worst_{ENGRAM_RUNG_PLAN};

  StateWatch<P> watch_;
  DelayedCommands<P> sent_;
  bool commanded_ = false, holding_ = false, overspeed_ = false;
  int64_t utime_ = 0;  // us, of the last command
  Hold hold_;
  double tau_[nu] = {};  // last command
};

template <class P, int N, class Hold> bool FastLoop<P, N, Hold>::plan_law(int64_t utime, bool good, double* tau) const {
  const Order<P, N>& plan = exchange_.value();
  const int k = plan.knot_at(utime + options_.delay_us);
  std::memcpy(tau, plan.s.u[k], sizeof(double) * nu);
  if (good) {
    double x[P::nx], dx[P::Layout::nxp];
    plan_state(plan, utime, x);
    P::difference(x, watch_.x, dx);
    if (options_.delay_us > 0) sent_.predict(plan, utime, options_.delay_us, dx);
    for (int i = 0; i < nu; ++i)
      for (int j = 0; j < P::Layout::nxp; ++j) tau[i] -= plan.s.K[k][i][j] * dx[j];
  }
  return all_finite(tau, nu);
}

template <class P, int N, class Hold> bool FastLoop<P, N, Hold>::hold_law(const double* v, double* tau) {
  if (!holding_) hold_.begin(options_.hold_rate, watch_.x);
  holding_ = true;
  hold_.hold(watch_.x, v, tau);
  return all_finite(tau, nu);
}

template <class P, int N, class Hold> void FastLoop<P, N, Hold>::limit(int64_t utime, double* tau) {
  const double since = 1e-6 * static_cast<double>(std::min<int64_t>(utime - utime_, options_.state_gap_us));
  for (int i = 0; i < nu; ++i) {
    const double lo = P::u_lo(i), hi = P::u_hi(i), step = options_.torque_rate * hi * since;
    tau[i] = std::clamp(tau[i], lo, hi);
    if (commanded_) tau[i] = std::clamp(tau[i], tau_[i] - step, tau_[i] + step);
  }
}

template <class P, int N, class Hold>
engram_status FastLoop<P, N, Hold>::command(int64_t utime, const double* q, const double* v, double* tau) {
  if (commanded_ && utime < utime_) {
    std::memcpy(tau, tau_, sizeof(tau_));
    return ENGRAM_STALE_STATE;
  }
  const bool good = watch_.take(utime, q, v);
  const int64_t blind = watch_.any ? utime - watch_.utime : options_.off_after_us + 1;  // time without a good state
  exchange_.refresh();
  const Plan<P, N>& plan = exchange_.value();
  engram_status status = static_cast<engram_status>(status_.load(std::memory_order_relaxed));
  engram_rung rung = plan.n > 0 ? ENGRAM_RUNG_PLAN : ENGRAM_RUNG_HOLD;
  if (plan.n > 0 && utime - alive_.load(std::memory_order_acquire) > options_.plan_age_us) {
    rung = ENGRAM_RUNG_HOLD;
    status = ENGRAM_STALE_PLAN;
  }
  double fastest = 0.0;  // relative to the limit
  for (int i = base; good && i < nv; ++i) fastest = std::max(fastest, std::fabs(v[i]) / R::v_max[i]);
  if (good) overspeed_ = fastest > (overspeed_ ? 1.0 : Hold::kOverspeed);
  if (overspeed_) rung = ENGRAM_RUNG_DAMPING;
  if (!good) {
    status = ENGRAM_BAD_STATE;
    if (blind > options_.state_gap_us) rung = ENGRAM_RUNG_DAMPING;
    if (blind > options_.off_after_us) rung = ENGRAM_RUNG_OFF;
  }

  const double still[nv] = {};
  const double* const v_used = good ? v : still;
  if (rung != ENGRAM_RUNG_HOLD) holding_ = false;
  if (rung == ENGRAM_RUNG_PLAN && !plan_law(utime, good, tau)) rung = ENGRAM_RUNG_HOLD;
  if (rung == ENGRAM_RUNG_HOLD && !hold_law(v_used, tau)) rung = ENGRAM_RUNG_DAMPING;
  if (rung == ENGRAM_RUNG_DAMPING && !(hold_.damp(watch_.x, v_used, tau), all_finite(tau, nu))) rung = ENGRAM_RUNG_OFF;
  if (rung == ENGRAM_RUNG_OFF) std::memset(tau, 0, sizeof(tau_));
  else limit(utime, tau);

  if (rung > worst_.load(std::memory_order_relaxed)) worst_.store(rung, std::memory_order_relaxed);
  std::memcpy(tau_, tau, sizeof(tau_));
  if (options_.delay_us > 0) sent_.sent(utime, tau);
  utime_ = utime;
  commanded_ = true;
  return status;
}

}  // namespace engram
#endif  // CONTROLLER_LOOP_LOOP_FAST_H_
