// One optimal control problem of the benches: numbers for the equality gate, and times, in the order of bench/peers.
#ifndef BENCH_PROBLEM_BENCH_H_
#define BENCH_PROBLEM_BENCH_H_

#ifndef ENGRAM_SINGLE
#include "bench/counting.h"
#endif
#include "bench/stopwatch.h"
#include "codegen/offline/dense_model.h"
#include "controller/fddp/fddp_solve.h"
#include "controller/ocp/ocp_contact.h"

#include <algorithm>
#include <memory>
#include <string>
#include <vector>

namespace engram::bench {

using ::bench::fail;
using ::bench::Report;
using ::bench::sample_us;

constexpr double kStop = 1e-9;
// In single precision kStop is below the rounding of a cost; it does not get better after so many.
constexpr int kMaxIterations = sizeof(Real) == sizeof(double) ? 200 : 30;
constexpr double kDisplacement = 1e-3;  // of the first state, in every tangent direction: what one control period sees

constexpr int kMaxKnots = 100;

template <class P> struct Problem {
  Horizon<P, kMaxKnots> horizon;
  FddpWork<P, kMaxKnots> work;
  FddpSolution<P, kMaxKnots> solution;
  FddpStats stats;
};

// Blocks of dense derivatives, row by row, as Crocoddyl stores them; nu = 0 at an impact.
template <class P>
void append_dense(const typename P::LqModel& m, double dt, bool terminal, int nu, double cost, std::vector<double> (&out)[8]) {
  using L = typename P::Layout;
  constexpr int ndx = P::ndx;
  auto& [costs, Fx, Fu, Lx, Lu, Lxx, Lxu, Luu] = out;
  costs.push_back(cost);
  for (int i = 0; i < ndx; ++i) {
    Lx.push_back(m.Lz[padded_index<L>(i)]);
    for (int j = 0; j < ndx; ++j) Lxx.push_back(offline::dense_hessian(m, i, j));
  }
  if (terminal) return;
  double Fx_k[ndx * ndx], Fu_k[ndx * P::nu];
  offline::dense_dynamics<P>(m, dt, Fx_k, Fu_k);
  Fx.insert(Fx.end(), Fx_k, Fx_k + ndx * ndx);
  Fu.insert(Fu.end(), Fu_k, Fu_k + ndx * nu);
  for (int i = 0; i < ndx; ++i)
    for (int j = 0; j < nu; ++j) Lxu.push_back(offline::dense_hessian(m, i, ndx + j));
  for (int i = 0; i < nu; ++i) {
    Lu.push_back(m.Lz[L::ou + i]);
    for (int j = 0; j < nu; ++j) Luu.push_back(offline::dense_hessian(m, ndx + i, ndx + j));
  }
}

// Controls of knot k: none at an impact.
template <class P, int N> int controls(const Horizon<P, N>& h, int k) { return P::kPhases && (h.phase[k] & kImpact) ? 0 : P::nu; }

// The controls of s, knot after knot.
template <class P, int N> std::vector<double> flat_controls(const Horizon<P, N>& h, const FddpSolution<P, N>& s) {
  std::vector<double> u;
  for (int k = 0; k < h.n; ++k) u.insert(u.end(), s.u[k], s.u[k] + controls(h, k));
  return u;
}

// The cost of knot k alone, which the solver only sums.
template <class P, int N> double cost_of_knot(const Horizon<P, N>& h, const FddpSolution<P, N>& s, int k) {
  Real x_next[P::nx], cost;
  if (k == h.n) P::calc_terminal(h.knot[k], s.x[k], cost);
  else if constexpr (P::kPhases) P::calc(h.phase[k], h.knot[k], s.x[k], s.u[k], x_next, cost);
  else P::calc(h.knot[k], s.x[k], s.u[k], x_next, cost);
  return cost;
}

// Flops of the Riccati sweep at one knot, from the dimensions of its products (fddp_backward.h); lower triangles only.
constexpr double backward_flops(int nv, int nu) {
  const double v = nv, u = nu, x = 2 * v, z = x + u;
  const double value = 4 * v * v;                                               // (Vqq, Vvq, Vvv) in (dq, dv')
  const double action = 2 * v * v * z + 2 * v * v * v                           // Vvv D, Dq' (...)
                        + 2 * v * (z * (z + 1) - v * (v + 1)) / 2 + 4 * v * z;  // rows v and u of D' W; gradients
  const double gain = u * u * u / 3 + 2 * u * u * x + u * x * (x + 1);          // Cholesky, Y, K, Y'Y
  return value + action + gain + 2 * u * (u + x);                               // k, Vx
}

// Flops of the dense step of a knot with contacts (contact_finish_dynamics): rows of nz, combined.
template <class P> double finish_flops(unsigned active) {
  using C = typename P::Contacts;
  const int rows = ActiveRows<C>(active).n;
  double terms = rows * (rows - 1);
  for (int k = 0; k < P::nv; ++k)
    for (int j = kTree<typename P::R>.parent[k]; j >= 0; j = kTree<typename P::R>.parent[j]) ++terms;
  for (int c = 0; c < C::n; ++c)
    if (contact_active(active, c)) terms += kContactTree<C>.path_n[c] * kContactTree<C>.rows[c];
  return 2.0 * P::nz * terms;
}

#ifndef ENGRAM_SINGLE
// Flops of the phases over the horizon, costs of forces left out of the sweep.
template <class P> void report_flops(const Problem<P>& problem, Report& report) {
  const auto& [h, w, s, stats] = problem;
  using S = Counting;
  constexpr int knot_size = sizeof(typename P::template Knot<Real>) / sizeof(Real);
  double linearize = 0.0, calc = 0.0;
  for (int k = 0; k <= h.n; ++k) {
    typename P::template Knot<S> knot;
    for (int e = 0; e < knot_size; ++e) reinterpret_cast<S*>(&knot)[e] = reinterpret_cast<const Real*>(&h.knot[k])[e];
    S x[P::nx], u[P::nu], x_next[P::nx], cost;
    for (int i = 0; i < P::nx; ++i) x[i] = s.x[k][i];
    for (int i = 0; i < P::nu; ++i) u[i] = k < h.n ? s.u[k][i] : 0.0;
    if constexpr (P::kPhases) {
      const auto lanes = std::make_unique<typename P::template LanesOf<S>>();
      linearize += count_flops([&] { P::linearize(h.phase_of(k), knot, x, u, x_next, cost, *lanes); });
      if (k == h.n) continue;
      linearize += finish_flops<P>(h.phase[k] & ~kImpact);
      calc += count_flops([&] { P::calc(h.phase[k], knot, x, u, x_next, cost); });
    } else {
      typename P::template Model<S> model;
      linearize += count_flops([&] { P::linearize(knot, x, u, x_next, cost, model); });
      if (k < h.n) calc += count_flops([&] { P::calc(knot, x, u, x_next, cost); });
    }
  }
  const double backward = h.n * backward_flops(P::nv, P::nu), policy = 2.0 * P::nu * (P::ndx + 1) + P::ndx;
  const double forward = kLanes * (calc + h.n * policy);
  report.number("flops_calcdiff", linearize);
  report.number("flops_backward", backward);
  report.number("flops_forward", forward);
  report.number("flops_solve1", linearize + backward + forward);
}

#endif

// Bytes that the phases move between memory and processor at least once, over the horizon: what a knot leaves for the next phase and what
// that reads of it; the scratch stays in the caches.
template <class P> void report_bytes(int knots, Report& report) {
  constexpr double model = sizeof(typename P::LqModel), gains = sizeof(Real) * P::nu * P::Layout::nxp;
  constexpr double parameters = sizeof(typename P::template Knot<Real>), point = sizeof(Real) * (P::nx + P::nu);
  constexpr double vectors = sizeof(Real) * (2.0 * P::Layout::nxp + P::Layout::nup);  // f, Vf, k
  const double calcdiff = knots * (parameters + point + model), backward = knots * (model + gains + vectors);
  const double forward = knots * (parameters + point + gains + vectors + kLanes * point);
  report.number("bytes_calcdiff", calcdiff);
  report.number("bytes_backward", backward);
  report.number("bytes_forward", forward);
  report.number("bytes_solve1", calcdiff + backward + forward);
}

template <class P> void compare(Problem<P>& problem, const std::vector<double>& trajectory) {
  using L = typename P::Layout;
  auto& [h, w, s, stats] = problem;
  const int n = h.n;
  if (trajectory.size() != (n + 1) * P::nx + flat_controls(h, s).size()) fail("trajectory of another size");
  const auto cold = std::make_unique<FddpSolution<P, kMaxKnots>>(s);
  std::copy_n(trajectory.begin(), (n + 1) * P::nx, s.x[0]);
  auto u = trajectory.begin() + (n + 1) * P::nx;
  for (int t = 0; t < n; u += controls(h, t++)) std::copy_n(u, controls(h, t), s.u[t]);

  FddpOpts opts;
  opts.reg_init = 0.0;
  fddp_start(opts, w, stats);
  if (!fddp_linearize(h, s, w) || !fddp_backward(h, opts, w, s)) fail("no direction at this trajectory");
  std::vector<double> dense[8], gap, K, k;
  for (int t = 0; t <= n; ++t) {
    const int nu = t < n ? controls(h, t) : 0;
    append_dense<P>(w.model[t], h.knot[t].dt, t == n, nu, cost_of_knot(h, s, t), dense);
    for (int i = 0; i < P::ndx; ++i) gap.push_back(w.f[t][padded_index<L>(i)]);
    for (int i = 0; i < nu; ++i) {
      k.push_back(w.k[t][i]);
      for (int j = 0; j < P::ndx; ++j) K.push_back(s.K[t][i][padded_index<L>(j)]);
    }
  }
  Report report;
  report.list("x0", {h.x0, h.x0 + P::nx});
  const char* const names[] = {"cost", "Fx", "Fu", "Lx", "Lu", "Lxx", "Lxu", "Luu"};
  for (int i = 0; i < 8; ++i) report.list(names[i], dense[i]);
  report.list("gap", gap);
  report.list("K", K);
  report.list("k", k);

  opts = {};
  opts.stop = kStop;
  opts.iterations = kMaxIterations;
  s = *cold;
  report.list("xs_cold", {s.x[0], s.x[0] + (n + 1) * P::nx});
  report.list("us_cold", flat_controls(h, s));
  report.number("converged", fddp_solve(h, opts, w, s, stats) == FddpStatus::kConverged);
  report.number("iterations", stats.iterations);
  report.number("cost_converged", s.cost);
#ifndef ENGRAM_SINGLE  // they are those of double precision
  report_flops(problem, report);
#endif
  report_bytes<P>(h.n, report);
  report.number("memory", sizeof(problem));
  report.list("xs_converged", {s.x[0], s.x[0] + (n + 1) * P::nx});
  report.list("us_converged", flat_controls(h, s));
}

template <class P> void time(Problem<P>& problem, int samples) {
  using L = typename P::Layout;
  auto& [h, w, s, stats] = problem;
  FddpOpts opts;
  opts.stop = kStop;
  opts.iterations = kMaxIterations;
  const FddpStatus status = fddp_solve(h, opts, w, s, stats);
  if (status != FddpStatus::kConverged && (sizeof(Real) == sizeof(double) || status != FddpStatus::kIterationLimit)) fail("does not converge");
  fddp_linearize(h, s, w);
  fddp_backward(h, opts, w, s);

  Report report;
  report.list("calcdiff", sample_us(samples, [&] { fddp_linearize(h, s, w); }));
  report.list("backward", sample_us(samples, [&] { fddp_backward(h, opts, w, s); }));
  // the step lengths 1, 1/2, 1/4, 1/8 at once; the peer's sample is of one
  Pack alpha, dv;
  for (int i = 0; i < kLanes; ++i) alpha.l[i] = 1.0 / (1 << i);
  report.list("forward", sample_us(samples, [&] { fddp_rollout(h, opts, s, alpha, w, dv); }));

  // one control period: one iteration from the solution, for a first state nearby
  const auto solution = std::make_unique<FddpSolution<P, kMaxKnots>>(s);
  Real dx[L::nxp] = {}, x0[P::nx];
  for (int i = 0; i < P::ndx; ++i) dx[padded_index<L>(i)] = kDisplacement;
  P::integrate(h.x0, dx, x0);
  std::copy_n(x0, P::nx, h.x0);
  opts.iterations = 1;
  opts.stop = 1e-30;
  report.list("solve1", sample_us(samples, [&] {
                s = *solution;
                fddp_solve(h, opts, w, s, stats);
              }));
  report.number("solve1_cost", s.cost);
}

// compare or time, as the command line says.
template <class P> void run_problem(Problem<P>& problem, const std::string& command, const char* argument) {
  if (command == "compare") compare(problem, ::bench::read_numbers(argument));
  else time(problem, std::atoi(argument));
}

}  // namespace engram::bench
#endif  // BENCH_PROBLEM_BENCH_H_
