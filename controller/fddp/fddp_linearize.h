// Step 1 of an iteration: the linear-quadratic model of every knot at (xs, us), kLanes knots of one phase at a time, and the gaps.
#ifndef CONTROLLER_FDDP_FDDP_LINEARIZE_H_
#define CONTROLLER_FDDP_FDDP_LINEARIZE_H_

#include "controller/fddp/fddp.h"

#include <cmath>

namespace engram {

// Knots side by side: `count` of them, then the last one repeated.
struct KnotLanes {
  int count = 0;
  int index[kLanes];

  void push(int k) { index[count++] = k; }
  void fill() {
    for (int i = count; i < kLanes; ++i) index[i] = index[count - 1];
  }
  // The knots `by` later, none beyond last.
  KnotLanes shifted(int by, int last) const {
    KnotLanes to = *this;
    for (int& k : to.index) k = k + by < last ? k + by : last;
    return to;
  }
};

// Calls f(lanes) for all knots 0 .. h.n, those of one phase together (in order of their first knots), so that lanes run alike.
template <class P, int N, class F> void for_lanes_of_knots(const Horizon<P, N>& h, F f) {
  bool placed[N + 1] = {};
  for (int first = 0; first <= h.n; ++first) {
    if (placed[first]) continue;
    KnotLanes lanes;
    for (int k = first; k <= h.n; ++k) {
      if (P::kPhases && h.phase_of(k) != h.phase_of(first)) continue;
      placed[k] = true;
      lanes.push(k);
      if (lanes.count < kLanes) continue;
      f(lanes);
      lanes.count = 0;
    }
    if (lanes.count == 0) continue;
    lanes.fill();
    f(lanes);
  }
}

// n doubles of each of kLanes records -> n packs.
template <class Record> inline void gather(const Record* records, const KnotLanes& knots, int n, Pack* out) {
  const Real* from[kLanes];
  for (int i = 0; i < kLanes; ++i) from[i] = reinterpret_cast<const Real*>(&records[knots.index[i]]);
  for (int e = 0; e < n; ++e) {
    Pack p = 0.0;
    for (int i = 0; i < kLanes; ++i) p.l[i] = from[i][e];
    out[e] = p;
  }
}

// n packs -> n doubles of each of the lanes' records.
inline void scatter(const Pack* in, int n, Real* const* to) {
  for (int e = 0; e < n; ++e)
    for (int i = 0; i < kLanes; ++i) to[i][e] = in[e].l[i];
}

template <class P, int N> void fddp_scatter_models(const typename P::Lanes& lanes, FddpWork<P, N>& w, const KnotLanes& knots) {
  using L = typename P::Layout;
  Real* to[kLanes];
  const auto block = [&](auto member, const Pack* in, int n) {
    for (int i = 0; i < kLanes; ++i) to[i] = member(w.model[knots.index[i]]);
    scatter(in, n, to);
  };
  block([](auto& m) { return &m.D[0][0]; }, &lanes.D[0][0], P::nv * L::nzp);
  block([](auto& m) { return m.Lz; }, lanes.Lz, L::nzp);
  for (int r = 0; r < L::nzp; ++r) block([r](auto& m) { return m.Lzz[r]; }, lanes.Lzz[r], padded(r + 1));
  if constexpr (P::kFreeBase) {
    block([](auto& m) { return m.E.data(); }, lanes.E.data(), 36);
    block([](auto& m) { return m.G.data(); }, lanes.G.data(), 36);
  }
}

// Models, costs (one a knot) and gaps of the knots `here`, in the scratch of one thread.
template <class P, int N>
void fddp_linearize_lanes(const Horizon<P, N>& h, const FddpSolution<P, N>& s, const KnotLanes& here, typename P::Lanes& lanes, Real* costs,
                          FddpWork<P, N>& w) {
  using L = typename P::Layout;
  constexpr int knot_size = sizeof(typename P::template Knot<Real>) / sizeof(Real);
  typename P::template Knot<Pack> knot;
  static_assert(sizeof(knot) == knot_size * sizeof(Pack), "a Knot holds scalars only");
  Pack x[P::nx], u[P::nu], x_next[P::nx], x_there[P::nx], cost, f[L::nxp];
  gather(h.knot, here, knot_size, reinterpret_cast<Pack*>(&knot));
  gather(s.x, here, P::nx, x);
  gather(s.u, here.shifted(0, h.n > 0 ? h.n - 1 : 0), P::nu, u);
  for (int j = 0; j < kLanes; ++j)  // the terminal knot has no control
    if (here.index[j] == h.n)
      for (int i = 0; i < P::nu; ++i) u[i].l[j] = 0.0;
  if constexpr (P::kPhases) {
    const unsigned phase = h.phase_of(here.index[0]);
    P::linearize(phase, knot, x, u, x_next, cost, lanes);
    for (int i = 0; i < here.count; ++i) P::finish(phase, h.knot[here.index[i]].dt, lanes, i, w.model[here.index[i]]);
  } else {
    P::linearize(knot, x, u, x_next, cost, lanes);
    fddp_scatter_models(lanes, w, here);
  }
  for (int i = 0; i < here.count; ++i) costs[here.index[i]] = cost.l[i];

  if (!w.feasible) {  // f_{k+1} = f(x_k, u_k) (-) x_{k+1}
    gather(s.x, here.shifted(1, h.n), P::nx, x_there);
    P::difference(x_there, x_next, f);
    for (int i = 0; i < here.count; ++i)
      if (here.index[i] < h.n)
        for (int e = 0; e < L::nxp; ++e) w.f[here.index[i] + 1][e] = f[e].l[i];
  }
}

// Fills w.model, w.f, w.gap and w.cost. False if a cost or a gap is not finite.
template <class P, int N>
bool fddp_linearize(const Horizon<P, N>& h, const FddpSolution<P, N>& s, FddpWork<P, N>& w, const FddpThreads& pool = {}) {
  using L = typename P::Layout;
  struct Job {
    const Horizon<P, N>& h;
    const FddpSolution<P, N>& s;
    FddpWork<P, N>& w;
    int threads, blocks = 0;
    KnotLanes block[N + 1];
    Real costs[N + 1];

    // Each thread takes every threads-th block; none writes what another one reads.
    static void run(void* job, int thread) {
      Job& j = *static_cast<Job*>(job);
      for (int b = thread; b < j.blocks; b += j.threads)
        fddp_linearize_lanes(j.h, j.s, j.block[b], thread == 0 ? j.w.lanes : j.w.more_lanes[thread - 1], j.costs, j.w);
    }
  };
  const bool alone = !pool.run || pool.threads < 2 || !w.more_lanes;
  Job job{h, s, w, alone ? 1 : pool.threads, 0, {}, {}};
  for_lanes_of_knots(h, [&](const KnotLanes& here) { job.block[job.blocks++] = here; });
  if (alone) Job::run(&job, 0);
  else pool.run(pool.self, &Job::run, &job);
  w.cost = 0.0;
  for (int b = 0; b < job.blocks; ++b)
    for (int i = 0; i < job.block[b].count; ++i) w.cost += job.costs[job.block[b].index[i]];
  if (!w.feasible) P::difference(s.x[0], h.x0, w.f[0]);
  else
    for (int k = 0; k <= h.n; ++k)
      for (int e = 0; e < L::nxp; ++e) w.f[k][e] = 0.0;

  Real largest = 0.0;
  w.gap = 0.0;
  for (int k = 0; k <= h.n; ++k)
    for (int e = 0; e < L::nxp; ++e) {
      const Real a = std::fabs(w.f[k][e]);
      w.gap += a;
      largest = a > largest ? a : largest;
    }
  w.largest_gap = largest;
  return std::isfinite(w.cost) && std::isfinite(w.gap);
}

}  // namespace engram
#endif  // CONTROLLER_FDDP_FDDP_LINEARIZE_H_
