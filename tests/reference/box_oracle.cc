// The arm of bench/problems.h with weak motors, solved within the box of its controls, for tests in Python (ctypes).
#include "bench/problems.h"
#include "controller/fddp/fddp_solve.h"

#include <algorithm>

namespace engram {
namespace {

constexpr int N = 30;
struct WeakPanda : robots::Panda {
  static constexpr double u_max[nu] = {10.0, 40.0, 10.0, 25.0, 2.0, 3.0, 1.5};  // N m
};
using R = robots::Panda;
using Weak = Ocp<WeakPanda, FramePlacementTerm<WeakPanda, R::kHandTcp>, StateTerm<WeakPanda>, ControlTerm<WeakPanda, false>>;

}  // namespace
}  // namespace engram

// us (N x nu), limit (nu). Returns 0 if it converges.
extern "C" int box_arm(double stop, double* us, double* limit, double* cost, int* iterations) {
  using namespace engram;
  static Horizon<bench::Arm, N> plain;
  static FddpSolution<bench::Arm, N> start;
  static Horizon<Weak, N> h;
  static FddpWork<Weak, N> w;
  static FddpSolution<Weak, N> s;
  static FddpStats stats;
  bench::arm_horizon(N, R::q_home, plain);
  bench::arm_cold_start(plain, start);
  h.n = N;
  std::copy_n(plain.x0, Weak::nx, h.x0);
  static_assert(sizeof(h.knot) == sizeof(plain.knot), "the same parameters");
  for (int k = 0; k <= N; ++k) {
    std::copy_n(reinterpret_cast<const double*>(&plain.knot[k]), sizeof(plain.knot[k]) / sizeof(double), reinterpret_cast<double*>(&h.knot[k]));
    std::copy_n(start.x[k], Weak::nx, s.x[k]);
    if (k < N) std::copy_n(start.u[k], Weak::nu, s.u[k]);
  }
  FddpOpts opts;
  opts.box = true;
  opts.stop = stop;
  opts.iterations = 200;
  if (fddp_solve(h, opts, w, s, stats) != FddpStatus::kConverged) return 1;
  std::copy_n(s.u[0], N * Weak::nu, us);
  std::copy_n(WeakPanda::u_max, int(Weak::nu), limit);
  *cost = s.cost;
  *iterations = stats.iterations;
  return 0;
}
