// Commands that act late: what the deviation from the plan will be when the command of now acts.
//
// The command that answers the state of time t acts at t + d. Until then those of the last d act, which are known:
//   e = x (-) x*,   du(s) = tau(s - d) - u*(s),   e_v' = (D (e_q, e_v, du) - e_v) / dt,   e_q' = e_v      from s = t to t + d
// D = d v' / d (q, v, u) of the knot under way (ocp_knot_model.h). Feedback on e(t + d) is what it would be without the delay, as far as
// the model holds.
// Source: Manitius and Olbrot, Finite spectrum assignment problem for systems with delays (IEEE TAC 1979).
#ifndef CONTROLLER_LOOP_LOOP_DELAY_H_
#define CONTROLLER_LOOP_LOOP_DELAY_H_

#include "controller/loop/loop_plan.h"

#include <algorithm>

namespace engram {

// The linear model of a plan's first knots, and the plan: what the fast side needs.
template <class P, int N> struct Order : Plan<P, N> {
  static constexpr int kKnots = N < 2 ? N : 2;
  alignas(64) Real D[kKnots][P::nv][P::Layout::nzp] = {};  // filled where commands act late, else 0
};

template <class P> class DelayedCommands {
 public:
  static constexpr int nv = P::nv, nu = P::nu;

  // tau (nu) was sent at utime.
  void sent(int64_t utime, const double* tau) {
    last_ = (last_ + 1) % kCommands;
    utime_[last_] = utime;
    std::memcpy(tau_[last_], tau, sizeof(tau_[last_]));
    n_ = std::min(n_ + 1, kCommands);
  }
  void forget() { n_ = 0; }

  // dx (padded), the deviation at time t, becomes that at t + delay.
  template <int N> void predict(const Order<P, N>& plan, int64_t t, int64_t delay, double* dx) const {
    using L = typename P::Layout;
    alignas(64) Real z[L::nzp] = {}, next[nv];
    for (int i = 0; i < L::nxp; ++i) z[i] = dx[i];
    for (int i = n_ - 1; i >= 0; --i) {  // oldest first
      const int at = (last_ + kCommands - i) % kCommands;
      const int64_t begin = std::max(utime_[at] + delay, t);
      const int64_t end = i > 0 ? utime_[(at + 1) % kCommands] + delay : t + delay;
      if (end <= begin) continue;
      const int k = plan.knot_at(begin), model = std::min(k, Order<P, N>::kKnots - 1);
      const double h = 1e-6 * static_cast<double>(end - begin), share = h / plan.dt(model);
      for (int j = 0; j < nu; ++j) z[L::ou + j] = tau_[at][j] - plan.s.u[k][j];
      for (int j = 0; j < nv; ++j) {
        Real v = 0.0;
        for (int c = 0; c < L::nzp; ++c) v += plan.D[model][j][c] * z[c];
        next[j] = v;
      }
      for (int j = 0; j < nv; ++j) {
        const double v = z[L::ov + j], v_next = v + share * (next[j] - v);
        z[L::oq + j] += 0.5 * h * (v + v_next);
        z[L::ov + j] = v_next;
      }
    }
    for (int i = 0; i < L::nxp; ++i) dx[i] = z[i];
  }

 private:
  static constexpr int kCommands = 64;  // at 1 kHz more than ENGRAM_DELAY_MAX_US
  int n_ = 0, last_ = 0;
  int64_t utime_[kCommands];
  double tau_[kCommands][nu];
};

}  // namespace engram
#endif  // CONTROLLER_LOOP_LOOP_DELAY_H_
