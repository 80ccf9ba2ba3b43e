// Our solver and rigid-body algorithms on the benchmark problems: numbers for the equality gate, and times.
//
//   engram_bench compare PROBLEM TRAJECTORY    derivatives and gains at a given trajectory, and the converged solve
//   engram_bench time PROBLEM N                N samples of each phase [us]
//   engram_bench compare ROBOT SAMPLES         rigid-body algorithms at given samples q v a tau
//   engram_bench time ROBOT SAMPLES N          N passes over the samples, one state after the other and in lanes [us per sample]
//   engram_bench gemm N                        GFLOP/s of Eigen's fixed-size double product under our flags
//
// Same input, same output, same order of entries as the programs of bench/peers. Writes one JSON object.
#include "bench/counting.h"
#include "bench/gemm.h"
#include "bench/problems.h"
#include "bench/stopwatch.h"
#include "controller/fddp/fddp_solve.h"
#include "controller/rbd/rbd_aba.h"
#include "controller/rbd/rbd_derivatives.h"

#include <algorithm>
#include <cstring>
#include <memory>
#include <string>

namespace engram::bench {
namespace {

using ::bench::read_numbers;
using ::bench::Report;
using ::bench::sample_us;

constexpr double kStop = 1e-9;
constexpr int kMaxIterations = 200;
constexpr double kDisplacement = 1e-3;  // of the first state, in every tangent direction: what one control period sees

[[noreturn]] void fail(const std::string& what) {
  std::fprintf(stderr, "%s\n", what.c_str());
  std::exit(1);
}

// ---- optimal control -----------------------------------------------------------------------------------------------------

constexpr int kMaxKnots = 100;

template <class P> struct Problem {
  Horizon<P, kMaxKnots> horizon;
  FddpWork<P, kMaxKnots> work;
  FddpSolution<P, kMaxKnots> solution;
  FddpStats stats;
};

// Blocks of dense derivatives, row by row, as Crocoddyl stores them.
template <class P> void append_dense(const KnotModel<typename P::Layout, P::kFreeBase, double>& m, double dt, bool terminal,
                                     double cost, std::vector<double> (&out)[8]) {
  static_assert(!P::kFreeBase, "E and G are taken as identities");
  using L = typename P::Layout;
  auto& [costs, Fx, Fu, Lx, Lu, Lxx, Lxu, Luu] = out;
  const auto Lzz = [&](int i, int j) {
    const int a = padded_index<L>(i), b = padded_index<L>(j);
    return m.Lzz[std::max(a, b)][std::min(a, b)];
  };
  costs.push_back(cost);
  for (int i = 0; i < P::ndx; ++i) {
    Lx.push_back(m.Lz[padded_index<L>(i)]);
    for (int j = 0; j < P::ndx; ++j) Lxx.push_back(Lzz(i, j));
  }
  if (terminal) return;
  for (int i = 0; i < P::ndx; ++i) {
    const double* const D = m.D[i % P::nv];
    const double step = i < P::nv ? dt : 1.0;  // dq' = dq + dt dv'
    for (int j = 0; j < P::ndx; ++j) Fx.push_back(step * D[padded_index<L>(j)] + (i < P::nv && i == j));
    for (int j = 0; j < P::nu; ++j) {
      Fu.push_back(step * D[L::ou + j]);
      Lxu.push_back(Lzz(i, P::ndx + j));
    }
  }
  for (int i = 0; i < P::nu; ++i) {
    Lu.push_back(m.Lz[L::ou + i]);
    for (int j = 0; j < P::nu; ++j) Luu.push_back(Lzz(P::ndx + i, P::ndx + j));
  }
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

// Flops of the phases over the horizon.
template <class P> void report_flops(const Problem<P>& problem, Report& report) {
  const auto& [h, w, s, stats] = problem;
  using S = Counting;
  typename P::template Knot<S> knot;
  constexpr int knot_size = sizeof(typename P::template Knot<double>) / sizeof(double);
  for (int e = 0; e < knot_size; ++e) reinterpret_cast<S*>(&knot)[e] = reinterpret_cast<const double*>(&h.knot[0])[e];
  S x[P::nx], u[P::nu], x_next[P::nx], cost;
  for (int i = 0; i < P::nx; ++i) x[i] = s.x[0][i];
  for (int i = 0; i < P::nu; ++i) u[i] = s.u[0][i];
  typename P::template Model<S> model;
  const double linearize = count_flops([&] { P::linearize(knot, x, u, x_next, cost, model); });
  const double calc = count_flops([&] { P::calc(knot, x, u, x_next, cost); });
  const double calc_diff = (h.n + 1) * linearize, backward = h.n * backward_flops(P::nv, P::nu);
  const double policy = 2.0 * P::nu * (P::ndx + 1) + P::ndx;
  const double forward = kLanes * h.n * (calc + policy);
  report.number("flops_calcdiff", calc_diff);
  report.number("flops_backward", backward);
  report.number("flops_forward", forward);
  report.number("flops_solve1", calc_diff + backward + forward);
}

template <class P> void compare(Problem<P>& problem, const std::vector<double>& trajectory) {
  using L = typename P::Layout;
  auto& [h, w, s, stats] = problem;
  const int n = h.n;
  if (int(trajectory.size()) != (n + 1) * P::nx + n * P::nu) fail("trajectory of another size");
  const std::vector<double> x_cold(s.x[0], s.x[0] + (n + 1) * P::nx), u_cold(s.u[0], s.u[0] + n * P::nu);
  std::copy_n(trajectory.begin(), (n + 1) * P::nx, s.x[0]);
  std::copy_n(trajectory.begin() + (n + 1) * P::nx, n * P::nu, s.u[0]);

  FddpOpts opts;
  opts.reg_init = 0.0;
  fddp_start(opts, w, stats);
  if (!fddp_linearize(h, s, w) || !fddp_backward(h, opts, w, s)) fail("no direction at this trajectory");
  std::vector<double> dense[8], gap, K, k;
  for (int t = 0; t <= n; ++t) {
    double x_next[P::nx], cost;
    const double no_control[P::nu] = {};
    KnotModel<L, P::kFreeBase, double> model;  // one knot by itself: its cost, which the solver only sums
    P::linearize(h.knot[t], s.x[t], t < n ? s.u[t] : no_control, x_next, cost, model);
    append_dense<P>(w.model[t], h.knot[t].dt, t == n, cost, dense);
    for (int i = 0; i < P::ndx; ++i) gap.push_back(w.f[t][padded_index<L>(i)]);
    for (int i = 0; t < n && i < P::nu; ++i) {
      k.push_back(w.k[t][i]);
      for (int j = 0; j < P::ndx; ++j) K.push_back(s.K[t][i][padded_index<L>(j)]);
    }
  }
  Report report;
  report.list("x0", h.x0, P::nx);
  const char* const names[] = {"cost", "Fx", "Fu", "Lx", "Lu", "Lxx", "Lxu", "Luu"};
  for (int i = 0; i < 8; ++i) report.list(names[i], dense[i]);
  report.list("gap", gap);
  report.list("K", K);
  report.list("k", k);

  opts = {};
  opts.stop = kStop;
  opts.iterations = kMaxIterations;
  std::copy(x_cold.begin(), x_cold.end(), s.x[0]);
  std::copy(u_cold.begin(), u_cold.end(), s.u[0]);
  report.list("xs_cold", x_cold);
  report.list("us_cold", u_cold);
  report.number("converged", fddp_solve(h, opts, w, s, stats) == FddpStatus::kConverged);
  report.number("iterations", stats.iterations);
  report.number("cost_converged", s.cost);
  report_flops(problem, report);
  report.list("xs_converged", s.x[0], (n + 1) * P::nx);
  report.list("us_converged", s.u[0], n * P::nu);
}

template <class P> void time(Problem<P>& problem, int samples) {
  using L = typename P::Layout;
  auto& [h, w, s, stats] = problem;
  FddpOpts opts;
  opts.stop = kStop;
  opts.iterations = kMaxIterations;
  if (fddp_solve(h, opts, w, s, stats) != FddpStatus::kConverged) fail("does not converge");
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
  double dx[L::nxp] = {}, x0[P::nx];
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

// ---- rigid-body algorithms -----------------------------------------------------------------------------------------------

template <class R> struct Sample { const double *q, *v, *a, *tau; };

template <class R> std::vector<Sample<R>> split(const std::vector<double>& numbers) {
  constexpr int size = R::nq + 3 * R::nv;
  if (numbers.size() % size) fail("samples of another robot");
  std::vector<Sample<R>> samples;
  for (std::size_t i = 0; i < numbers.size(); i += size) {
    const double* const q = &numbers[i];
    samples.push_back({q, q + R::nq, q + R::nq + R::nv, q + R::nq + 2 * R::nv});
  }
  return samples;
}

// Results of all algorithms at one state (one state a lane when S = Pack).
template <class R, class S> struct RigidBody {
  S q[R::nq], v[R::nv], a[R::nv], tau[R::nv];
  RbdData<R, S> d;
  S out[R::nv];
  Mat<S, R::nv, R::nv> A, B, C;

  void load(const std::vector<Sample<R>>& samples, std::size_t first) {
    for (int l = 0; l < lanes_of<S>; ++l) {
      const Sample<R>& s = samples[std::min(first + l, samples.size() - 1)];
      for (int i = 0; i < R::nq; ++i) set_lane(q[i], l, s.q[i]);
      for (int i = 0; i < R::nv; ++i) {
        set_lane(v[i], l, s.v[i]);
        set_lane(a[i], l, s.a[i]);
        set_lane(tau[i], l, s.tau[i]);
      }
    }
  }
  void fk() { rbd_kinematics(q, d); }
  void rnea() { rbd_rnea(q, v, a, d, out); }
  void aba() { rbd_aba(q, v, tau, d, out); }
  void crba() {
    rbd_kinematics(q, d);
    rbd_crba(d, A);
  }
  void rnea_derivatives() {
    rbd_rnea(q, v, a, d, out);
    rbd_composite_inertias(d);
    rbd_rnea_derivatives(d, A, B);
  }
  void aba_derivatives() {
    rbd_forward_dynamics(q, v, tau, d, out);
    rbd_forward_derivatives(q, v, tau, d, out, A, B, C);
  }
};

template <class R> void compare(const std::vector<double>& numbers) {
  const auto samples = split<R>(numbers);
  constexpr int nv = R::nv;
  RigidBody<R, double> body;
  std::vector<double> p_WJ, tau, acc, M, tau_q, tau_v, acc_q, acc_v;
  const auto append = [](std::vector<double>& to, const double* from, int n) { to.insert(to.end(), from, from + n); };
  for (std::size_t i = 0; i < samples.size(); ++i) {
    body.load(samples, i);
    body.fk();
    for (const auto& p : body.d.p_WJ) append(p_WJ, p.data(), 3);
    body.rnea();
    append(tau, body.out, nv);
    body.aba();
    append(acc, body.out, nv);
    body.crba();
    append(M, body.A.data(), nv * nv);
    body.rnea_derivatives();
    append(tau_q, body.A.data(), nv * nv);
    append(tau_v, body.B.data(), nv * nv);
    body.aba_derivatives();
    append(acc_q, body.A.data(), nv * nv);
    append(acc_v, body.B.data(), nv * nv);
  }
  Report report;
  report.list("fk", p_WJ);
  report.list("rnea", tau);
  report.list("aba", acc);
  report.list("crba", M);
  report.list("rnea_derivatives_q", tau_q);
  report.list("rnea_derivatives_v", tau_v);
  report.list("aba_derivatives_q", acc_q);
  report.list("aba_derivatives_v", acc_v);

  RigidBody<R, Counting> counted;
  counted.load(samples, 0);
  report.number("flops_fk", count_flops([&] { counted.fk(); }));
  report.number("flops_rnea", count_flops([&] { counted.rnea(); }));
  report.number("flops_aba", count_flops([&] { counted.aba(); }));
  report.number("flops_crba", count_flops([&] { counted.crba(); }));
  report.number("flops_rnea_derivatives", count_flops([&] { counted.rnea_derivatives(); }));
  report.number("flops_aba_derivatives", count_flops([&] { counted.aba_derivatives(); }));
}

// The samples are loaded before the clock starts: a lane's state arrives in lanes from the solver, too.
template <class R, class S>
void time(Report& report, const std::string& suffix, const std::vector<Sample<R>>& samples, int passes) {
  std::vector<RigidBody<R, S>> bodies((samples.size() + lanes_of<S> - 1) / lanes_of<S>);
  for (std::size_t i = 0; i < bodies.size(); ++i) bodies[i].load(samples, i * lanes_of<S>);
  const auto measure = [&](const char* name, void (RigidBody<R, S>::*algorithm)()) {
    const auto pass = [&] {
      for (auto& body : bodies) {
        (body.*algorithm)();
        ::bench::keep(body);
      }
    };
    report.list((name + suffix).c_str(), sample_us(passes, pass, double(bodies.size() * lanes_of<S>)));
  };
  using Body = RigidBody<R, S>;
  measure("fk", &Body::fk);
  measure("rnea", &Body::rnea);
  measure("aba", &Body::aba);
  measure("crba", &Body::crba);
  measure("rnea_derivatives", &Body::rnea_derivatives);
  measure("aba_derivatives", &Body::aba_derivatives);
}

template <class R> void time(const std::vector<double>& numbers, int passes) {
  const auto samples = split<R>(numbers);
  Report report;
  time<R, double>(report, "", samples, passes);
  time<R, Pack>(report, "_lanes", samples, passes);
}

int knots_of(const std::string& problem) { return problem == "arm30" ? 30 : problem == "arm100" ? 100 : 0; }

int run(int argc, char** argv) {
  const auto argument = [&](int i) {
    return i < argc ? argv[i] : (fail("too few arguments, see the head of engram_bench.cc"), "");
  };
  const std::string command = argument(1), what = argument(2);
  if (command == "gemm") {
    Report report;
    ::bench::report_gemm(report, std::atoi(what.c_str()));
  } else if (const int T = knots_of(what)) {
    static Problem<Arm> problem;
    arm_horizon(T, robots::Panda::q_home, problem.horizon);
    arm_cold_start(problem.horizon, problem.solution);
    if (command == "compare") compare(problem, read_numbers(argument(3)));
    else time(problem, std::atoi(argument(3)));
  } else if (what == robots::Panda::name) {
    if (command == "compare") compare<robots::Panda>(read_numbers(argument(3)));
    else time<robots::Panda>(read_numbers(argument(3)), std::atoi(argument(4)));
  } else {
    fail("unknown problem or robot " + what);
  }
  return 0;
}

}  // namespace
}  // namespace engram::bench

int main(int argc, char** argv) { return engram::bench::run(argc, argv); }
