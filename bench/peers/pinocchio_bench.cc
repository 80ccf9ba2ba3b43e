// Pinocchio's rigid-body algorithms: numbers for the equality gate, and times; and this machine's matrix product rate.
//
//   pinocchio_bench MODEL compare SAMPLES    results at given samples
//   pinocchio_bench MODEL time SAMPLES N     N passes over the samples, per algorithm [us per sample]
//   pinocchio_bench - gemm N                 GFLOP/s of Eigen's fixed-size double product
//
// SAMPLES holds q v a tau per sample. Header-only and compiled for this very machine: the peer at its best.
#include "bench/gemm.h"
#include "bench/peers/model_text.h"
#include "bench/stopwatch.h"

#include <cstring>
#include <pinocchio/algorithm/aba-derivatives.hpp>
#include <pinocchio/algorithm/aba.hpp>
#include <pinocchio/algorithm/crba.hpp>
#include <pinocchio/algorithm/kinematics.hpp>
#include <pinocchio/algorithm/rnea-derivatives.hpp>
#include <pinocchio/algorithm/rnea.hpp>

namespace bench {
namespace {

using Vector = Eigen::VectorXd;
using Matrix = Eigen::MatrixXd;

struct Sample {
  Vector q, v, a, tau;
};

std::vector<Sample> split(const pinocchio::Model& model, const std::vector<double>& numbers) {
  const std::size_t size = model.nq + 3 * model.nv;
  if (numbers.size() % size) throw std::runtime_error("samples of another robot");
  std::vector<Sample> samples;
  for (const double* s = numbers.data(); s != numbers.data() + numbers.size(); s += size) {
    const double* v = s + model.nq;
    samples.push_back({Eigen::Map<const Vector>(s, model.nq), Eigen::Map<const Vector>(v, model.nv),
                       Eigen::Map<const Vector>(v + model.nv, model.nv), Eigen::Map<const Vector>(v + 2 * model.nv, model.nv)});
  }
  return samples;
}

void append(std::vector<double>& numbers, const Matrix& m) {
  for (int i = 0; i < m.rows(); ++i)
    for (int j = 0; j < m.cols(); ++j) numbers.push_back(m(i, j));
}

void compare(const pinocchio::Model& model, const std::vector<Sample>& samples) {
  pinocchio::Data data(model);
  std::vector<double> p_WJ, tau, acc, M, tau_q, tau_v, acc_q, acc_v;
  for (const Sample& s : samples) {
    pinocchio::forwardKinematics(model, data, s.q);
    for (int i = 1; i < model.njoints; ++i) append(p_WJ, data.oMi[i].translation());
    append(tau, pinocchio::rnea(model, data, s.q, s.v, s.a));
    append(acc, pinocchio::aba(model, data, s.q, s.v, s.tau));
    pinocchio::crba(model, data, s.q);
    append(M, Matrix(data.M.selfadjointView<Eigen::Upper>()));
    pinocchio::computeRNEADerivatives(model, data, s.q, s.v, s.a);
    append(tau_q, data.dtau_dq);
    append(tau_v, data.dtau_dv);
    pinocchio::computeABADerivatives(model, data, s.q, s.v, s.tau);
    append(acc_q, data.ddq_dq);
    append(acc_v, data.ddq_dv);
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
}

void time(const pinocchio::Model& model, const std::vector<Sample>& samples, int n) {
  using pinocchio::Convention;
  pinocchio::Data data(model);
  Report report;
  const auto measure = [&](const char* name, auto&& algorithm) {
    const auto pass = [&] {
      for (const Sample& s : samples) algorithm(s);
    };
    report.list(name, sample_us(n, pass, double(samples.size())));
  };
  measure("fk", [&](const Sample& s) { pinocchio::forwardKinematics(model, data, s.q); });
  measure("rnea", [&](const Sample& s) { pinocchio::rnea(model, data, s.q, s.v, s.a); });
  measure("aba", [&](const Sample& s) { pinocchio::aba(model, data, s.q, s.v, s.tau, Convention::LOCAL); });
  measure("aba_world", [&](const Sample& s) { pinocchio::aba(model, data, s.q, s.v, s.tau, Convention::WORLD); });
  measure("crba", [&](const Sample& s) { pinocchio::crba(model, data, s.q, Convention::LOCAL); });
  measure("crba_world", [&](const Sample& s) { pinocchio::crba(model, data, s.q, Convention::WORLD); });
  measure("rnea_derivatives", [&](const Sample& s) { pinocchio::computeRNEADerivatives(model, data, s.q, s.v, s.a); });
  measure("aba_derivatives", [&](const Sample& s) { pinocchio::computeABADerivatives(model, data, s.q, s.v, s.tau); });
}

}  // namespace
}  // namespace bench

int main(int argc, char** argv) try {
  const bool gemm = argc == 4 && !std::strcmp(argv[2], "gemm");
  if (!gemm && argc < 4) throw std::runtime_error("usage: pinocchio_bench MODEL compare|time SAMPLES [N], or - gemm N");
  if (gemm) {
    bench::Report report;
    bench::report_gemm(report, std::atoi(argv[3]));
    return 0;
  }
  const bench::RobotModel robot = bench::read_model(argv[1]);
  const std::vector<bench::Sample> samples = bench::split(robot.model, bench::read_numbers(argv[3]));
  if (!std::strcmp(argv[2], "compare")) bench::compare(robot.model, samples);
  else bench::time(robot.model, samples, argc > 4 ? std::atoi(argv[4]) : 100);
  return 0;
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
