// RNEA, ABA, CRBA, their derivatives and forward kinematics of Panda and Talos, one state after the other and in lanes.
#include "bench/rigid_body_bench.h"

#ifndef ENGRAM_SINGLE
#include "bench/counting.h"
#endif
#include "bench/stopwatch.h"
#include "controller/rbd/rbd_aba.h"
#include "controller/rbd/rbd_derivatives_rows.h"
#include "tables/panda/robot.h"
#include "tables/talos/robot.h"

#include <algorithm>
#include <vector>

namespace engram::bench {
namespace {

using ::bench::fail;
using ::bench::Report;
using ::bench::sample_us;

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

// A matrix of derivatives: padded rows for one state, plain ones for states in lanes.
template <class R, class S> struct DerivativeMatrix { using type = Mat<S, R::nv, R::nv>; };
template <class R> struct DerivativeMatrix<R, Real> { using type = RowMatrix<R>; };

// A state (one state a lane when S = Pack).
template <class R, class S> struct State {
  S q[R::nq], v[R::nv], a[R::nv], tau[R::nv];

  State(const std::vector<Sample<R>>& samples, std::size_t first) {
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
};

// All algorithms and their results: one work space for all states, like the peer's Data.
template <class R, class S> struct RigidBody {
  using Input = State<R, S>;
  RbdData<R, S> d;
  S out[R::nv];
  typename DerivativeMatrix<R, S>::type A, B, C;

  void fk(const Input& s) { rbd_kinematics(s.q, d); }
  void rnea(const Input& s) { rbd_rnea(s.q, s.v, s.a, d, out); }
  void aba(const Input& s) { rbd_aba(s.q, s.v, s.tau, d, out); }
  void crba(const Input& s) {  // into the upper triangle of a matrix, as Pinocchio's
    rbd_kinematics(s.q, d);
    rbd_crba_upper(d, A);
  }
  void rnea_derivatives(const Input& s) {
    rbd_rnea(s.q, s.v, s.a, d, out);
    rbd_composite_inertias(d);
    rbd_rnea_derivatives(d, A, B);
  }
  void aba_derivatives(const Input& s) {
    rbd_forward_dynamics(s.q, s.v, s.tau, d, out);
    rbd_forward_derivatives(d, out, A, B, C);
  }
};

template <class R, class M> void append_matrix(std::vector<double>& to, const M& m, bool upper_of_symmetric = false) {
  for (int i = 0; i < R::nv; ++i)
    for (int j = 0; j < R::nv; ++j) to.push_back(upper_of_symmetric && j < i ? m(j, i) : m(i, j));
}

template <class R> void compare(const std::vector<double>& numbers) {
  const auto samples = split<R>(numbers);
  static RigidBody<R, Real> body;
  std::vector<double> p_WJ, tau, acc, M, tau_q, tau_v, acc_q, acc_v;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const State<R, Real> s(samples, i);
    body.fk(s);
    for (const auto& p : body.d.p_WJ) p_WJ.insert(p_WJ.end(), p.data(), p.data() + 3);
    body.rnea(s);
    tau.insert(tau.end(), body.out, body.out + R::nv);
    body.aba(s);
    acc.insert(acc.end(), body.out, body.out + R::nv);
    body.A.set_zero();
    body.crba(s);
    append_matrix<R>(M, body.A, true);
    body.rnea_derivatives(s);
    append_matrix<R>(tau_q, body.A);
    append_matrix<R>(tau_v, body.B);
    body.aba_derivatives(s);
    append_matrix<R>(acc_q, body.A);
    append_matrix<R>(acc_v, body.B);
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

#ifndef ENGRAM_SINGLE  // they are those of double precision
  static RigidBody<R, Counting> counted;
  const State<R, Counting> s(samples, 0);
  report.number("flops_fk", count_flops([&] { counted.fk(s); }));
  report.number("flops_rnea", count_flops([&] { counted.rnea(s); }));
  report.number("flops_aba", count_flops([&] { counted.aba(s); }));
  report.number("flops_crba", count_flops([&] { counted.crba(s); }));
  report.number("flops_rnea_derivatives", count_flops([&] { counted.rnea_derivatives(s); }));
  report.number("flops_aba_derivatives", count_flops([&] { counted.aba_derivatives(s); }));
#endif
}

// The states are loaded before the clock starts: a lane's state arrives in lanes from the solver, too.
template <class R, class S>
void time(Report& report, const std::string& suffix, const std::vector<Sample<R>>& samples, int passes) {
  using Body = RigidBody<R, S>;
  static Body body;
  std::vector<State<R, S>> states;
  for (std::size_t i = 0; i < samples.size(); i += lanes_of<S>) states.emplace_back(samples, i);
  const auto measure = [&](const char* name, void (Body::*algorithm)(const State<R, S>&)) {
    const auto pass = [&] {
      for (const State<R, S>& state : states) {
        (body.*algorithm)(state);
        ::bench::keep(body);
      }
    };
    report.list((name + suffix).c_str(), sample_us(passes, pass, double(states.size() * lanes_of<S>)));
  };
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
  time<R, Real>(report, "", samples, passes);
  time<R, Pack>(report, "_lanes", samples, passes);
}

template <class R> void run(const std::string& command, const char* file, int passes) {
  const std::vector<double> numbers = ::bench::read_numbers(file);
  if (command == "compare") compare<R>(numbers);
  else time<R>(numbers, passes);
}

}  // namespace

bool is_robot(const std::string& name) { return name == robots::Panda::name || name == robots::Talos::name; }

void run_rigid_body(const std::string& command, const std::string& robot, const char* file, int passes) {
  if (robot == robots::Panda::name) run<robots::Panda>(command, file, passes);
  else run<robots::Talos>(command, file, passes);
}

}  // namespace engram::bench
