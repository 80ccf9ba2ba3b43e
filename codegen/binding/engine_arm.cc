// The benches' arm problem in Python: Crocoddyl's arm example on a Panda.
#include "bench/problems.h"
#include "codegen/binding/engine_problems.h"
#include "codegen/binding/problem.h"

namespace engram::binding {
namespace {

constexpr int kMaxKnots = 100;

class Arm : public Problem<bench::Arm, kMaxKnots> {
 public:
  explicit Arm(int T) {
    if (T < 1 || T > kMaxKnots) throw nb::value_error(("T: expected 1 .. " + std::to_string(kMaxKnots)).c_str());
    bench::arm_horizon(T, robots::Panda::q_home, h());
  }

  nb::dict cold_start() {
    bench::arm_cold_start(h(), s());
    return solution();
  }

  nb::dict ipopt(const In<2>& xs, const In<2>& us, int iterations, double tolerance, bool limited_memory) {
    offline::IpoptOptions options;
    options.iterations = iterations;
    options.tolerance = tolerance;
    options.limited_memory = limited_memory;
    return solve_nlp(xs, us, options, {}, offline::PathConstraint{});
  }
};

}  // namespace

void bind_arm(nb::module_& engine) {
  using namespace nb::literals;
  nb::class_<Arm> arm(engine, "Arm", "Panda reach of Crocoddyl's arm example: T knots of 10 ms from the nominal posture.");
  arm.def(nb::init<int>(), "T"_a);
  bind_problem<Arm>(arm);
  arm.def("cold_start", &Arm::cold_start, "xs, us that stand still at the first state under the gravity torque.")
      .def("ipopt", &Arm::ipopt, "xs"_a, "us"_a, "iterations"_a = 500, "tolerance"_a = 1e-9, "limited_memory"_a = false,
           "The same problem as a multiple-shooting program, by Ipopt: xs, us, cost, status, converged, violation, iterations.");
}

}  // namespace engram::binding
