// The cost of a trajectory (xs, us) as it is rolled out without gaps, with the gains of a sweep at it, as the fast side would execute it.
// Apart from the rollout by which the controller chooses (loop_rolled.h):
//   J = sum_k l_k(x_k, u_k) + l_N(x_N),   u_k = us_k - K_k (x_k (-) xs_k) within the torque limits,   x_{k+1} = f(x_k, u_k),   x_0 as expected
// Without gains both trajectories diverge within the horizon, and tell nothing.
#include "bench/pole_witness.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "controller/loop/loop_controller.h"
#include "controller/loop/loop_receding.h"
#include "controller/loop/loop_talos_pole.h"
#include "tables/talos_pole/tables.h"
#include "tests/support/random_tables.h"

namespace engram {
namespace {

TabKnn knn = talos_pole_knn_v1;
TabPca path = talos_pole_path_v1;
constexpr PoleTables kTables = {&knn, &path};
using Model = LeggedModel<TalosPoleRemembers<kTables>>;

PoleWitness witness = {};

class WatchedPlanner : public RecedingPlanner<Model> {
 public:
  WatchedPlanner(const engram_options& options, Fast& fast) : RecedingPlanner<Model>(options, fast), shifted_(options) {}

  engram_status prepare(int64_t utime) {
    const double reg = this->Core::solve_.reg();  // with which the shifted plan is swept
    const engram_status status = RecedingPlanner<Model>::prepare(utime);
    const engram_cycle& c = this->Core::cycle_;
    if (c.nguess < 2) return status;
    ++witness.asked;
    if (c.winner != ENGRAM_CANDIDATE_KNN) return status;
    ++witness.accepted;
    const Solve<Model>& taken_over = this->Core::solve_;
    shifted_.horizon = taken_over.horizon;
    shifted_.plan.n = N;
    std::memcpy(shifted_.plan.utime, taken_over.plan.utime, sizeof shifted_.plan.utime);
    shifted_.start(seed_.x, seed_.u, reg);
    const double shifted = shifted_.ready() ? rolled(shifted_) : HUGE_VAL, taken = rolled(taken_over);
    if (!(taken <= shifted)) {
      ++witness.above;
      witness.worst = std::fmax(witness.worst, (taken - shifted) / shifted);
    }
    return status;
  }

 private:
  static double rolled(const Solve<Model>& solve) {
    const Horizon<P, N>& h = solve.horizon;
    const auto& s = solve.plan.s;
    double x[P::nx], next[P::nx], u[P::nu], dx[P::Layout::nxp], cost, sum = 0.0;
    std::memcpy(x, h.x0, sizeof x);
    for (int k = 0; k < N; ++k) {
      P::difference(s.x[k], x, dx);
      for (int i = 0; i < P::nu; ++i) {
        u[i] = s.u[k][i];
        for (int j = 0; j < P::ndx; ++j) u[i] -= s.K[k][i][padded_index<P::Layout>(j)] * dx[padded_index<P::Layout>(j)];
        u[i] = std::clamp<double>(u[i], P::u_lo(i), P::u_hi(i));
      }
      P::calc(h.phase[k], h.knot[k], x, u, next, cost);
      std::memcpy(x, next, sizeof x);
      sum += cost;
    }
    P::calc_terminal(h.knot[N], x, cost);
    return std::isfinite(sum + cost) ? sum + cost : HUGE_VAL;
  }

  Solve<Model> shifted_;  // swept anew: the planner's own sweep is gone by then
};

test::RandomTables random_tables;

}  // namespace
}  // namespace engram

PoleWitness& pole_witness() { return engram::witness; }

void pole_random_tables() {
  using namespace engram;
  knn.x = random_tables.fill(knn.head, 3, 1.0f);
  knn.value = random_tables.fill(knn.head, 4, 3.0f);
  path.mean = random_tables.fill(path.head, 2, 1.5f);
  path.basis = random_tables.fill(path.head, 3, 0.5f);
  test::RandomTables::sign(knn.head);
  test::RandomTables::sign(path.head);
}

extern "C" constexpr engram_model engram_talos_pole_witness = engram::loop_model<engram::Model, engram::WatchedPlanner>("talos", "pole");
