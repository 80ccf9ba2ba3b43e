// Crocoddyl on the benchmark problems: numbers for the equality gate, and times.
//
//   crocoddyl_bench MODEL compare PROBLEM TRAJECTORY   derivatives and gains at a given trajectory, and the converged solve
//   crocoddyl_bench MODEL time PROBLEM N               N samples of each phase [us]
//
// MODEL is a file of export_models.py, TRAJECTORY the numbers x0 .. xT u0 .. uT-1. Writes one JSON object.
#include "bench/peers/crocoddyl_problems.h"
#include "bench/stopwatch.h"

#include <cstring>

#include "crocoddyl/core/solvers/fddp.hpp"

namespace bench {
namespace {

constexpr double kStop = 1e-9;  // converged: Crocoddyl's criterion below this
constexpr int kMaxIterations = 200;
constexpr double kDisplacement = 1e-3;  // of the first state, in every tangent direction: what one control period sees

// Row-major entries of all matrices, one after the other.
template <class Matrices> std::vector<double> flat(const Matrices& matrices) {
  std::vector<double> numbers;
  for (const auto& m : matrices)
    for (int i = 0; i < m.rows(); ++i)
      for (int j = 0; j < m.cols(); ++j) numbers.push_back(m(i, j));
  return numbers;
}

// A field of every running model's data, then (if asked for) of the terminal one.
template <class Field>
std::vector<double> flat_field(const crocoddyl::ShootingProblem& shooting, bool with_terminal, Field field) {
  std::vector<Eigen::MatrixXd> values;
  for (const auto& data : shooting.get_runningDatas()) values.push_back(field(*data));
  if (with_terminal) values.push_back(field(*shooting.get_terminalData()));
  return flat(values);
}

void compare(Problem& problem, const std::vector<double>& trajectory) {
  using Data = crocoddyl::ActionDataAbstract;
  crocoddyl::ShootingProblem& shooting = *problem.shooting;
  const std::size_t T = shooting.get_T(), nx = shooting.get_nx();
  std::size_t size = (T + 1) * nx;
  for (const auto& u : problem.us) size += u.size();  // none at an impact
  if (trajectory.size() != size) throw std::runtime_error("trajectory of another size");
  Vectors xs(T + 1), us(T);
  const double* next = trajectory.data();
  for (auto& x : xs) x = Eigen::Map<const Eigen::VectorXd>(next, nx), next += nx;
  for (std::size_t t = 0; t < T; next += us[t++].size()) us[t] = Eigen::Map<const Eigen::VectorXd>(next, problem.us[t].size());

  crocoddyl::SolverFDDP solver(problem.shooting);
  solver.setCandidate(xs, us, false);
  solver.set_preg(0);
  solver.set_dreg(0);
  solver.calcDiff();
  solver.backwardPass();
  Report report;
  report.list("x0", shooting.get_x0().data(), nx);
  report.list("cost", flat_field(shooting, true, [](const Data& d) { return Eigen::MatrixXd::Constant(1, 1, d.cost); }));
  report.list("gap", flat(solver.get_fs()));
  report.list("Fx", flat_field(shooting, false, [](const Data& d) { return d.Fx; }));
  report.list("Fu", flat_field(shooting, false, [](const Data& d) { return d.Fu; }));
  report.list("Lx", flat_field(shooting, true, [](const Data& d) { return d.Lx; }));
  report.list("Lu", flat_field(shooting, false, [](const Data& d) { return d.Lu; }));
  report.list("Lxx", flat_field(shooting, true, [](const Data& d) { return d.Lxx; }));
  report.list("Lxu", flat_field(shooting, false, [](const Data& d) { return d.Lxu; }));
  report.list("Luu", flat_field(shooting, false, [](const Data& d) { return d.Luu; }));
  report.list("K", flat(solver.get_K()));
  report.list("k", flat(solver.get_k()));

  crocoddyl::SolverFDDP converging(problem.shooting);
  converging.set_th_stop(kStop);
  const bool converged = converging.solve(problem.xs, problem.us, kMaxIterations, false);
  report.list("xs_cold", flat(problem.xs));
  report.list("us_cold", flat(problem.us));
  report.number("converged", converged);
  report.number("iterations", double(converging.get_iter() + 1));  // its count starts from 0
  report.number("cost_converged", converging.get_cost());
  report.list("xs_converged", flat(converging.get_xs()));
  report.list("us_converged", flat(converging.get_us()));
}

void time(Problem& problem, int n) {
  crocoddyl::ShootingProblem& shooting = *problem.shooting;
  crocoddyl::SolverFDDP solver(problem.shooting);
  solver.set_th_stop(kStop);
  solver.solve(problem.xs, problem.us, kMaxIterations, false);
  const Vectors xs = solver.get_xs(), us = solver.get_us();
  shooting.calc(xs, us);
  solver.setCandidate(xs, us, true);
  solver.calcDiff();
  solver.backwardPass();

  Report report;
  report.list("calc", sample_us(n, [&] { shooting.calc(xs, us); }));
  report.list("calcdiff", sample_us(n, [&] { shooting.calcDiff(xs, us); }));
  report.list("backward", sample_us(n, [&] { solver.backwardPass(); }));
  report.list("forward", sample_us(n, [&] { solver.forwardPass(1); }));

  // one control period: one iteration from the solution, for a first state nearby
  Eigen::VectorXd x0(shooting.get_nx());
  const Eigen::VectorXd dx = Eigen::VectorXd::Constant(shooting.get_ndx(), kDisplacement);
  shooting.get_runningModels()[0]->get_state()->integrate(shooting.get_x0(), dx, x0);
  shooting.set_x0(x0);
  solver.set_th_stop(1e-30);
  report.list("solve1", sample_us(n, [&] { solver.solve(xs, us, 1, false, 1e-9); }));
  report.number("solve1_cost", solver.get_cost());
}

}  // namespace
}  // namespace bench

int main(int argc, char** argv) try {
  if (argc != 5) throw std::runtime_error("usage: crocoddyl_bench MODEL compare|time PROBLEM TRAJECTORY|N");
  bench::Problem problem = bench::make_problem(argv[3], bench::read_model(argv[1]));
  if (!std::strcmp(argv[2], "compare")) bench::compare(problem, bench::read_numbers(argv[4]));
  else bench::time(problem, std::atoi(argv[4]));
  return 0;
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
