// Our solver and rigid-body algorithms on the benchmark problems: numbers for the equality gate, and times.
//
//   engram_bench compare PROBLEM TRAJECTORY    derivatives and gains at a given trajectory, and the converged solve
//   engram_bench time PROBLEM N                N samples of each phase [us]
//   engram_bench compare ROBOT SAMPLES         rigid-body algorithms at given samples q v a tau
//   engram_bench time ROBOT SAMPLES N          N passes over the samples, one state after the other and in lanes [us per sample]
//   engram_bench gemm N                        GFLOP/s of Eigen's fixed-size double product under our flags
//
// Same input, same output, same order of entries as the programs of bench/peers. Writes one JSON object.
#include "bench/gemm.h"
#include "bench/problem_bench.h"
#include "bench/problems.h"
#include "bench/rigid_body_bench.h"
#include "bench/whole_body_bench.h"

#include <string>

namespace engram::bench {
namespace {

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
    run_problem(problem, command, argument(3));
  } else if (is_whole_body(what)) {
    run_whole_body(command, what, argument(3));
  } else if (is_robot(what)) {
    run_rigid_body(command, what, argument(3), command == "time" ? std::atoi(argument(4)) : 0);
  } else {
    fail("unknown problem or robot " + what);
  }
  return 0;
}

}  // namespace
}  // namespace engram::bench

int main(int argc, char** argv) { return engram::bench::run(argc, argv); }
