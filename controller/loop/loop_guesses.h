// The guesses of one period, from whoever has one, by merit.
#ifndef CONTROLLER_LOOP_LOOP_GUESSES_H_
#define CONTROLLER_LOOP_LOOP_GUESSES_H_

#include "controller/loop/loop_goals.h"
#include "controller/loop/loop_merit.h"
#include "controller/loop/loop_plan.h"

namespace engram {

inline constexpr double kOtherEnd = 0.3;  // rad: guesses whose final postures differ by more lead to different optima

template <class M> class Guesses {
 public:
  using P = typename M::P;
  static constexpr int N = M::N;
  static_assert(M::Memory::kGuesses + 2 <= ENGRAM_GUESSES_MAX, "room for the memory's guesses and the loop's own two");

  int n = 0;
  Candidate<P> candidate[ENGRAM_GUESSES_MAX];

  void clear() { n = nused_ = 0; }
  // The plan under way, shifted to the knot times `utime`; its first state is x0.
  void add_shifted(const Plan<P, N>& plan, const int64_t (&utime)[N + 1], const double* x0) {
    resample(plan, utime, x0, shifted_);
    add(ENGRAM_CANDIDATE_SHIFTED, shifted_);
  }
  // A trajectory that was solved for but not executed: it may begin now.
  void add_postponed(const Plan<P, N>& plan, const double* x0) {
    std::memcpy(own_.x, plan.s.x, sizeof(own_.x));
    std::memcpy(own_.u, plan.s.u, sizeof(own_.u));
    std::memcpy(own_.x[0], x0, sizeof(own_.x[0]));
    add(ENGRAM_CANDIDATE_SHIFTED, own_);
  }
  void add_standing_still(const double* x0) {
    stand_still(x0, own_);
    add(ENGRAM_CANDIDATE_COLD, own_);
  }
  // What the memory proposes.
  void ask_memory(const typename M::Target& target, const Question& question, const double* x0, const int64_t (&utime)[N + 1]) {
    double t[N + 1];
    for (int k = 0; k <= N; ++k) t[k] = 1e-6 * static_cast<double>(utime[k] - utime[0]);
    n = memory_.guesses(target, question, x0, N, t, candidate, n);
  }
  // The memory as a metric: merit of its best guess from x0 for one goal, +infinity without one. The candidates are lost.
  double merit_of(const typename M::Target& goal, const double* x0, Horizon<P, N>& scratch) {
    double us[ENGRAM_CANDIDATE_COUNT], merit;
    loop_choose_goal<M>(
        &goal, 1, x0,
        [&](const typename M::Target& target, const double* t, Candidate<P>* found) {
          return memory_.guesses(target, {true, 0, nullptr, us}, x0, N, t, found, 0);
        },
        &merit, scratch, candidate);
    return merit;
  }
  void compare(const Horizon<P, N>& horizon) { loop_merit(horizon, candidate, n); }

  // Lowest merit. A shifted plan gives way only to a guess that is better by the share `gain`, gaps forgiven: the next step closes
  // them, and without this the plan would flutter. Null if no merit is finite.
  const Candidate<P>* best(double gain) {
    const Candidate<P>* best = nullptr;
    for (int i = 0; i < n; ++i) {
      const Candidate<P>& c = candidate[i];
      if (best == nullptr) best = &c;
      else if (best->kind != ENGRAM_CANDIDATE_SHIFTED || c.kind == ENGRAM_CANDIDATE_SHIFTED)
        best = c.merit < best->merit ? &c : best;
      else if (c.merit < (1.0 - gain) * (gain > 0.0 ? best->cost : best->merit)) best = &c;
    }
    return use(best);
  }
  // Among those that end elsewhere than all used before: the one of the rank-th lowest merit, 0 the lowest. Null if there is none.
  const Candidate<P>* another(int rank) {
    const Candidate<P>* last = nullptr;
    for (; rank >= 0; --rank) {
      const Candidate<P>* best = nullptr;
      for (int i = 0; i < n; ++i) {
        const Candidate<P>& c = candidate[i];
        if (last != nullptr && !(c.merit > last->merit)) continue;  // has an earlier rank
        bool elsewhere = true;
        for (int j = 0; j < nused_; ++j) elsewhere = elsewhere && ends_elsewhere(c, *used_[j]);
        if (elsewhere && (best == nullptr || c.merit < best->merit)) best = &c;
      }
      if (best == nullptr) break;
      last = best;
    }
    return rank < 0 ? use(last) : nullptr;
  }

 private:
  void add(engram_candidate kind, const Seed<P, N>& seed) { candidate[n++] = {kind, seed.x, seed.u, 0.0, 0.0, 0.0}; }
  const Candidate<P>* use(const Candidate<P>* c) {
    if (c == nullptr || !std::isfinite(c->merit)) return nullptr;
    return used_[nused_++] = c;
  }
  static bool ends_elsewhere(const Candidate<P>& a, const Candidate<P>& b) {
    double d[P::nv], most = 0.0;
    rbd_difference<typename P::R>(a.x[N], b.x[N], d);
    for (double di : d) most = std::fmax(most, std::fabs(di));
    return most > kOtherEnd;
  }

  Seed<P, N> shifted_, own_;
  typename M::Memory memory_;
  const Candidate<P>* used_[ENGRAM_GUESSES_MAX];
  int nused_ = 0;
};

}  // namespace engram
#endif  // CONTROLLER_LOOP_LOOP_GUESSES_H_
