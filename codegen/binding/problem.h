// An optimal control problem in Python: a horizon of the compiled problem P, its model, its solvers.
#ifndef CODEGEN_BINDING_PROBLEM_H_
#define CODEGEN_BINDING_PROBLEM_H_

#include "codegen/binding/arrays.h"
#include "codegen/offline/dense_model.h"
#include "codegen/offline/ipopt_shooting.h"
#include "controller/fddp/fddp_solve.h"
#include "controller/loop/loop_merit.h"

#include <nanobind/stl/string.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

namespace engram::binding {

inline const char* words(FddpStatus status) {
  switch (status) {
    case FddpStatus::kConverged:
      return "converged";
    case FddpStatus::kIterationLimit:
      return "iteration limit";
    case FddpStatus::kDeadline:
      return "deadline";
    case FddpStatus::kNotPositiveDefinite:
      return "not positive definite";
    case FddpStatus::kNotFinite:
      return "not finite";
    case FddpStatus::kBadHorizon:
      return "bad horizon";
  }
  return "unknown";
}

// At most N knots with a control. A derived class fills h.
template <class P_, int N_> class Problem {
 public:
  using P = P_;
  using L = typename P::Layout;
  static constexpr int N = N_, nx = P::nx, ndx = P::ndx, nv = P::nv, nu = P::nu, nz = ndx + nu;

  Problem() : state_(std::make_unique<State>()) {}

  int knots() const { return h().n; }
  Out x0() const { return vector(h().x0, nx); }
  void set_x0(const In<1>& x0) {
    check_shape<1>("x0", x0, {nx});
    std::copy_n(x0.data(), nx, h().x0);
  }

  // Costs (T + 1) and gaps (T + 1, ndx).
  nb::dict evaluate(const In<2>& xs, const In<2>& us) {
    load(xs, us);
    const std::size_t T = h().n;
    NewArray cost({T + 1}), gap({T + 1, ndx});
    double x_next[nx], f[L::nxp];
    std::copy_n(h().x0, nx, x_next);
    for (std::size_t k = 0; k <= T; ++k) {
      P::difference(s().x[k], x_next, f);
      unpad(f, ndx, gap.row(k));
      if (k < T) calc(k, x_next, *cost.row(k));
      else P::calc_terminal(h().knot[k], s().x[k], *cost.row(k));
    }
    nb::dict result;
    result["cost"] = cost.release();
    result["gap"] = gap.release();
    return result;
  }

  // The model the solver sweeps, without padding: D, E, G and Fx, Fu (dense, for comparison), Lz, Lzz, gaps, total cost.
  nb::dict linearize(const In<2>& xs, const In<2>& us) {
    load(xs, us);
    linearize_at_solution();
    const std::size_t T = h().n;
    NewArray D({T, nv, nz}), Fx({T, ndx, ndx}), Fu({T, ndx, nu}), Lz({T + 1, nz}), Lzz({T + 1, nz, nz}), gap({T + 1, ndx});
    for (std::size_t k = 0; k <= T; ++k) {
      const auto& m = w().model[k];
      unpad(m.Lz, nz, Lz.row(k));
      unpad(w().f[k], ndx, gap.row(k));
      for (int i = 0; i < nz; ++i)
        for (int j = 0; j < nz; ++j) Lzz.row(k)[i * nz + j] = offline::dense_hessian(m, i, j);
      if (k == T) break;
      for (int i = 0; i < nv; ++i) unpad(m.D[i], nz, D.row(k) + i * nz);
      offline::dense_dynamics<P>(m, h().knot[k].dt, Fx.row(k), Fu.row(k));
    }
    nb::dict result;
    result["cost"] = w().cost;
    result["gap"] = gap.release();
    result["D"] = D.release();
    result["Fx"] = Fx.release();
    result["Fu"] = Fu.release();
    result["Lz"] = Lz.release();
    result["Lzz"] = Lzz.release();
    return result;
  }

  // Gains K (T, nu, ndx) and k (T, nu) of one sweep at (xs, us).
  nb::tuple direction(const In<2>& xs, const In<2>& us, double reg) {
    load(xs, us);
    linearize_at_solution();
    FddpOpts opts;
    w().reg = reg;
    if (!fddp_backward(h(), opts, w(), s())) throw nb::value_error("Quu is not positive definite");
    const std::size_t T = h().n;
    NewArray k({T, nu});
    for (std::size_t t = 0; t < T; ++t) std::copy_n(w().k[t], nu, k.row(t));
    return nb::make_tuple(gains(), k.release());
  }

  // Merits (m) of the trajectories xs (m, T + 1, nx), us (m, T, nu).
  Out merit(const In<3>& xs, const In<3>& us) {
    check_shape<3>("xs", xs, {-1, h().n + 1, nx});
    check_shape<3>("us", us, {long(xs.shape(0)), h().n, nu});
    const std::size_t m = xs.shape(0), T = h().n;
    std::vector<Candidate<P>> candidates(m);
    for (std::size_t i = 0; i < m; ++i) {
      candidates[i].x = reinterpret_cast<const double(*)[nx]>(xs.data() + i * (T + 1) * nx);
      candidates[i].u = reinterpret_cast<const double(*)[nu]>(us.data() + i * T * nu);
    }
    {
      nb::gil_scoped_release release;
      loop_merit(h(), candidates.data(), int(m));
    }
    NewArray merit({m});
    for (std::size_t i = 0; i < m; ++i) merit.data()[i] = candidates[i].merit;
    return merit.release();
  }

  nb::dict solve(const In<2>& xs, const In<2>& us, int iterations, double stop, bool box, int step_lengths, double reg,
                 double stop_gradient) {
    if (step_lengths < 1 || step_lengths > kMaxStepLengths)
      throw nb::value_error(("step_lengths: expected 1 .. " + std::to_string(kMaxStepLengths)).c_str());
    load(xs, us);
    FddpOpts opts;
    opts.iterations = iterations;
    opts.stop = stop;
    opts.stop_gradient = stop_gradient;
    opts.box = box;
    opts.step_lengths = step_lengths;
    opts.reg_init = reg;
    FddpStats& stats = state_->stats;
    {
      nb::gil_scoped_release release;
      fddp_solve(h(), opts, w(), s(), stats);
    }
    const std::size_t logged = std::min(stats.iterations, int(FddpStats::kLog));
    NewArray log({logged, 6});
    for (std::size_t i = 0; i < logged; ++i) {
      const FddpIteration& it = stats.log[i];
      const double row[] = {it.cost, it.stop, it.step_length, it.reg, it.gap, it.gradient};
      std::copy_n(row, 6, log.row(i));
    }
    nb::dict result = solution();
    result["K"] = gains();
    result["cost"] = s().cost;
    result["status"] = words(stats.status);
    result["converged"] = stats.status == FddpStatus::kConverged;
    result["feasible"] = stats.feasible;
    result["iterations"] = stats.iterations;
    result["log"] = log.release();
    return result;
  }

  template <class Path> nb::dict solve_nlp(const In<2>& xs, const In<2>& us, const offline::IpoptOptions& options,
                                           const offline::StateBounds<P>& bounds, const Path& path) {
    load(xs, us);
    offline::IpoptResult found;
    {
      nb::gil_scoped_release release;
      offline::Shooting<P, N> shooting(h(), bounds, path);
      found = offline::ipopt_solve(shooting.program(), shooting.pack(s().x[0], s().u[0]), options);
    }
    for (int k = 0; k <= h().n; ++k) std::copy_n(&found.z[offline::Shooting<P, N>::x_at(k)], nx, s().x[k]);
    for (int k = 0; k < h().n; ++k) std::copy_n(&found.z[offline::Shooting<P, N>::u_at(k)], nu, s().u[k]);
    nb::dict result = solution();
    result["cost"] = found.objective;
    result["status"] = found.status;
    result["converged"] = found.solved;
    result["violation"] = found.violation;
    result["iterations"] = found.iterations;
    return result;
  }

 protected:
  struct State {
    Horizon<P, N> horizon{};
    FddpWork<P, N> work{};
    FddpSolution<P, N> solution{};
    FddpStats stats{};
  };
  Horizon<P, N>& h() { return state_->horizon; }
  const Horizon<P, N>& h() const { return state_->horizon; }
  FddpSolution<P, N>& s() { return state_->solution; }
  FddpWork<P, N>& w() { return state_->work; }

  static Out vector(const double* values, int n) {
    NewArray array({std::size_t(n)});
    std::copy_n(values, n, array.data());
    return array.release();
  }

  // The solution's states and controls.
  nb::dict solution() {
    const std::size_t T = h().n;
    NewArray xs({T + 1, nx}), us({T, nu});
    std::copy_n(s().x[0], (T + 1) * nx, xs.data());
    std::copy_n(s().u[0], T * nu, us.data());
    nb::dict result;
    result["xs"] = xs.release();
    result["us"] = us.release();
    return result;
  }

 private:
  void load(const In<2>& xs, const In<2>& us) {
    check_shape<2>("xs", xs, {h().n + 1, nx});
    check_shape<2>("us", us, {h().n, nu});
    std::copy_n(xs.data(), xs.size(), s().x[0]);
    std::copy_n(us.data(), us.size(), s().u[0]);
  }

  // Next state and cost of knot k of the trajectory that is loaded.
  void calc(std::size_t k, double* x_next, double& cost) {
    if constexpr (P::kPhases) P::calc(h().phase[k], h().knot[k], s().x[k], s().u[k], x_next, cost);
    else P::calc(h().knot[k], s().x[k], s().u[k], x_next, cost);
  }

  void linearize_at_solution() {
    fddp_start(FddpOpts{}, w(), state_->stats);
    if (!fddp_linearize(h(), s(), w())) throw nb::value_error("cost or gaps are not finite");
  }

  static void unpad(const double* padded, int n, double* out) {
    for (int i = 0; i < n; ++i) out[i] = padded[padded_index<L>(i)];
  }

  Out gains() {
    const std::size_t T = h().n;
    NewArray K({T, nu, ndx});
    for (std::size_t t = 0; t < T; ++t)
      for (int i = 0; i < nu; ++i) unpad(s().K[t][i], ndx, K.row(t) + i * ndx);
    return K.release();
  }

  std::unique_ptr<State> state_;
};

// Binds what all problems share.
template <class C, class Class> void bind_problem(Class& c) {
  using namespace nb::literals;
  c.def_prop_ro("T", &C::knots, "Knots with a control.")
      .def_prop_ro_static("nx", [](nb::handle) { return C::nx; })
      .def_prop_ro_static("ndx", [](nb::handle) { return C::ndx; })
      .def_prop_ro_static("nv", [](nb::handle) { return C::nv; })
      .def_prop_ro_static("nu", [](nb::handle) { return C::nu; })
      .def_prop_rw("x0", &C::x0, &C::set_x0, nb::for_getter(nb::rv_policy::move), "First state (nx).")
      .def("evaluate", &C::evaluate, "xs"_a, "us"_a,
           "Costs (T + 1) and gaps (T + 1, ndx) of a trajectory xs (T + 1, nx), us (T, nu).")
      .def("linearize", &C::linearize, "xs"_a, "us"_a,
           "Linear-quadratic model of every knot: D (T, nv, nz), Fx, Fu, Lz (T + 1, nz), Lzz (T + 1, nz, nz), gap, and the total "
           "cost.")
      .def("direction", &C::direction, "xs"_a, "us"_a, "reg"_a = 0.0,
           "Gains K (T, nu, ndx) and feed-forward k (T, nu) at a trajectory.")
      .def("merit", &C::merit, "xs"_a, "us"_a, "Merits (m) of m trajectories: cost + 10 L1 norm of the gaps.")
      .def("solve", &C::solve, "xs"_a, "us"_a, "iterations"_a = 100, "stop"_a = FddpOpts{}.stop, "box"_a = FddpOpts{}.box,
           "step_lengths"_a = FddpOpts{}.step_lengths, "reg"_a = FddpOpts{}.reg_init, "stop_gradient"_a = FddpOpts{}.stop_gradient,
           "FDDP from a guess: xs, us, K (T, nu, ndx), cost, status in words, converged, feasible, iterations, and the log "
           "(iterations, 6) with columns cost, stop, step_length, reg, gap, gradient. stop_gradient > 0 replaces stop: sum |Qu|^2. Releases the GIL; one solve at a time per object.");
}

}  // namespace engram::binding
#endif  // CODEGEN_BINDING_PROBLEM_H_
