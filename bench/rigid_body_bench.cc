// RNEA, ABA, CRBA, their derivatives and forward kinematics of Panda and Talos, one state after the other and in lanes.
#include "bench/rigid_body_bench.h"

#include "bench/counting.h"
#include "bench/stopwatch.h"
#include "controller/rbd/rbd_aba.h"
#include "controller/rbd/rbd_derivatives.h"
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
  void crba() {  // the triangle of M that dynamics uses; Pinocchio's crba leaves one, too
    rbd_kinematics(q, d);
    rbd_crba_branches(d, d.L);
  }
  void rnea_derivatives() {
    rbd_rnea(q, v, a, d, out);
    rbd_composite_inertias(d);
    rbd_rnea_derivatives(d, A, B);
  }
  void aba_derivatives() {
    rbd_forward_dynamics(q, v, tau, d, out);
    rbd_forward_derivatives(d, out, A, B, C);
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
    body.fk();
    rbd_crba(body.d, body.A);
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
