// talos30t, talos30: one step of Talos with the costs of the thesis and of Crocoddyl's example; talos100: four steps; anymal: a trot;
// quad33: Hector to a way point.
#include "bench/whole_body_bench.h"

#include "bench/legged_problems.h"
#include "bench/problem_bench.h"

namespace engram::bench {
namespace {

constexpr size_t kTalosBudget = 16'000'000;  // bytes of one solver of up to kMaxKnots knots, all of its memory

template <class P> void run_talos(int knots, int steps, double length, const std::string& command, const char* argument) {
  static Problem<P> problem;
  static_assert(sizeof(problem) <= kTalosBudget, "Crocoddyl takes 400 MB");
  TalosWalk<P, kMaxKnots>(knots, steps, length, problem.horizon);
  legged_cold_start(problem.horizon, problem.solution);
  run_problem(problem, command, argument);
}

constexpr const char* kProblems[] = {
    "talos30t", "anymal", "quad33",
#ifndef ENGRAM_FEWER_PROBLEMS  // for tests that need no more of them, and would take longer to compile than to run
    "talos30", "talos100",
#endif
};

}  // namespace

bool is_whole_body(const std::string& problem) {
  for (const char* name : kProblems)
    if (problem == name) return true;
  return false;
}

void run_whole_body(const std::string& command, const std::string& name, const char* argument) {
  if (name == "talos30t") {
    run_talos<TalosThesis>(30, 1, 0.3, command, argument);
#ifndef ENGRAM_FEWER_PROBLEMS
  } else if (name == "talos30") {
    run_talos<TalosUtils>(30, 1, 0.3, command, argument);
  } else if (name == "talos100") {
    run_talos<TalosUtils>(100, 4, 0.2, command, argument);
#endif
  } else if (name == "anymal") {
    static Problem<AnymalProblem> problem;
    AnymalTrot<kMaxKnots>{problem.horizon};
    legged_cold_start(problem.horizon, problem.solution);
    run_problem(problem, command, argument);
  } else {
    static Problem<Hector> problem;
    hector_horizon(problem.horizon);
    hector_cold_start(problem.horizon, problem.solution);
    run_problem(problem, command, argument);
  }
}

}  // namespace engram::bench
