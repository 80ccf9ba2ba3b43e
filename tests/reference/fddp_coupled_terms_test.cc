// options: -Og
// Terms that couple q with v, or forces of several contacts, reach the sweep: its gains against a dense Riccati recursion.
#include "codegen/offline/dense_model.h"
#include "controller/fddp/fddp_backward.h"
#include "controller/fddp/fddp_linearize.h"
#include "controller/ocp/ocp_contact.h"
#include "controller/ocp/ocp_motion_residuals.h"
#include "controller/ocp/ocp_regularization.h"
#include "controller/ocp/ocp_zmp.h"
#include "tables/anymal/robot.h"

#include <Eigen/Dense>
#include <gtest/gtest.h>

#include <cmath>
#include <memory>

namespace engram {
namespace {

using R = robots::Anymal;
struct Feet {
  using Robot = R;
  static constexpr int n = 3;
  static constexpr int frame[n] = {R::kLfFoot, R::kRfFoot, R::kRhFoot};
  static constexpr ContactKind kind[n] = {ContactKind::kPoint, ContactKind::kPoint, ContactKind::kPoint};
  static constexpr double kp = 0.0, kd = 10.0;
};
using Momentum = ResidualTerm<CentroidalMomentum<R>>;
using Velocity = ResidualTerm<FrameVelocity<R, R::kLhFoot, Axes::kLocalWorldAligned>>;
using Zmp = ZmpTerm<Feet>;
using P = ContactOcp<Feet, StateTerm<R>, ControlTerm<R, false>, Momentum, Velocity, Zmp>;
constexpr int T = 3, ndx = P::ndx, nu = P::nu;
using L = P::Layout;

double wave(int i) { return std::sin(1.0 + 2.3 * i); }

TEST(FddpCoupledTerms, GainsAreThoseOfADenseRiccatiRecursion) {
  auto h = std::make_unique<Horizon<P, T>>();
  auto w = std::make_unique<FddpWork<P, T>>();
  auto s = std::make_unique<FddpSolution<P, T>>();
  *h = {};
  h->n = T;
  for (int k = 0; k <= T; ++k) {
    auto& knot = h->knot[k];
    h->phase[k] = 7u;
    knot.dt = k < T ? 0.02 : 0.0;
    double dx[L::nxp] = {}, home[P::nx] = {};
    for (int i = 0; i < P::nq; ++i) home[i] = knot.state_ref[i] = R::q_home[i];
    for (int i = 0; i < P::nv; ++i) {
      dx[L::oq + i] = 0.1 * wave(i + 50 * k);
      dx[L::ov + i] = 0.3 * wave(i + 50 * k + 20);
    }
    P::integrate(home, dx, s->x[k]);
    for (int i = 0; k < T && i < nu; ++i) s->u[k][i] = 5.0 * wave(i + 7 * k);
    for (int i = 0; i < ndx; ++i) knot.state_w[i] = 0.5;
    knot.control_w = k < T ? 1e-2 : 0.0;
    for (int i = 0; i < 6; ++i) {
      param_of<Momentum>(knot).w[i] = 0.3 + 0.1 * i;
      param_of<Velocity>(knot).w[i] = 2.0 - 0.2 * i;
    }
    for (double& weight : param_of<Zmp>(knot).w) weight = k < T ? 4.0 : 0.0;
  }
  for (int i = 0; i < P::nx; ++i) h->x0[i] = s->x[0][i];
  w->feasible = false;
  w->reg = 0.0;
  ASSERT_TRUE(fddp_linearize(*h, *s, *w));
  ASSERT_TRUE(fddp_backward(*h, FddpOpts{}, *w, *s));
  for (int k = 0; k <= T; ++k) EXPECT_TRUE(w->model[k].coupled);

  const auto hessian = [&](int k, int rows, int from_row, int columns, int from_column) {
    Eigen::MatrixXd H(rows, columns);
    for (int i = 0; i < rows; ++i)
      for (int j = 0; j < columns; ++j) H(i, j) = offline::dense_hessian(w->model[k], from_row + i, from_column + j);
    return H;
  };
  const auto gradient = [&](int k, int size, int from) {
    Eigen::VectorXd g(size);
    for (int i = 0; i < size; ++i) g[i] = w->model[k].Lz[padded_index<L>(from + i)];
    return g;
  };
  Eigen::MatrixXd V = hessian(T, ndx, 0, ndx, 0);
  Eigen::VectorXd v = gradient(T, ndx, 0);
  for (int k = T - 1; k >= 0; --k) {
    Eigen::Matrix<double, ndx, ndx, Eigen::RowMajor> Fx;
    Eigen::Matrix<double, ndx, nu, Eigen::RowMajor> Fu;
    offline::dense_dynamics<P>(w->model[k], h->knot[k].dt, Fx.data(), Fu.data());
    Eigen::VectorXd f(ndx);
    for (int i = 0; i < ndx; ++i) f[i] = w->f[k + 1][padded_index<L>(i)];
    const Eigen::VectorXd ahead = v + V * f;
    const Eigen::MatrixXd Qxx = hessian(k, ndx, 0, ndx, 0) + Fx.transpose() * V * Fx;
    const Eigen::MatrixXd Quu = hessian(k, nu, ndx, nu, ndx) + Fu.transpose() * V * Fu;
    const Eigen::MatrixXd Qux = hessian(k, nu, ndx, ndx, 0) + Fu.transpose() * V * Fx;
    const Eigen::VectorXd Qx = gradient(k, ndx, 0) + Fx.transpose() * ahead, Qu = gradient(k, nu, ndx) + Fu.transpose() * ahead;
    const auto solver = Quu.ldlt();
    const Eigen::MatrixXd K = solver.solve(Qux);
    const Eigen::VectorXd feed = solver.solve(Qu);
    for (int i = 0; i < nu; ++i) {
      // rounding of the recursion, amplified by the condition of Quu (1e5)
      EXPECT_NEAR(w->k[k][i], feed[i], 1e-9 * feed.cwiseAbs().maxCoeff());
      for (int j = 0; j < ndx; ++j) EXPECT_NEAR(s->K[k][i][padded_index<L>(j)], K(i, j), 1e-9 * K.cwiseAbs().maxCoeff());
    }
    V = Qxx - Qux.transpose() * K;
    V = 0.5 * (V + V.transpose()).eval();
    v = Qx - Qux.transpose() * feed;
  }
}

}  // namespace
}  // namespace engram
