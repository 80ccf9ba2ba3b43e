// The exact step of a problem's dynamics, and its exact A and B, by CVODES: what a discrete step is measured against.
//
// q' = v on the manifold (a free base as position and quaternion), v' = a(q, v, u). The acceleration and its derivatives are those
// of a knot with dt = 1, v_next - v and D - I: here the *integrator* is on trial, dynamics and derivatives are elsewhere.
#ifndef TESTS_REFERENCE_CVODES_STEP_H_
#define TESTS_REFERENCE_CVODES_STEP_H_

#include "sim_harness/sim_cvodes.h"

#include <Eigen/Dense>
#include <gtest/gtest.h>

#include <cmath>

namespace engram {

inline constexpr double kCvodesTolerance = 1e-12;

// Hamilton product of a quaternion (x y z w) with (w, 0): what turns it.
inline void times_vector(const double* quat, const Eigen::Vector3d& w, double* out) {
  const Eigen::Vector3d v(quat[0], quat[1], quat[2]);
  const Eigen::Vector3d r = quat[3] * w + v.cross(w);
  out[0] = r[0], out[1] = r[1], out[2] = r[2], out[3] = -v.dot(w);
}

// A problem with phases, held in one of them.
template <class P_, unsigned phase> struct InPhase : P_ {
  using P = P_;
  template <class S> using Model = typename P::LqModel;
  template <class S> using Knot = typename P::template Knot<S>;
  static void calc(const Knot<double>& knot, const double* x, const double* u, double* x_next, double& cost) {
    P::calc(phase, knot, x, u, x_next, cost);
  }
  static void linearize(const Knot<double>& knot, const double* x, const double* u, double* x_next, double& cost, Model<double>& M) {
    static typename P::Lanes lanes;
    Knot<Pack> knots;
    Pack xs[P::nx], us[P::nu], next[P::nx], costs;
    std::copy(reinterpret_cast<const double*>(&knot), reinterpret_cast<const double*>(&knot + 1), reinterpret_cast<Pack*>(&knots));
    std::copy(x, x + P::nx, xs);
    std::copy(u, u + P::nu, us);
    P::linearize(phase, knots, xs, us, next, costs, lanes);
    P::finish(phase, knot.dt, lanes, 0, M);
    for (int i = 0; i < P::nx; ++i) x_next[i] = next[i].l[0];
    cost = costs.l[0];
  }
};

// P is a problem type without phases; FirstOrder: v' of a knot is q' itself (a system of first order), and v has no say.
template <class P, bool FirstOrder = false> class CvodesStep {
 public:
  using L = typename P::Layout;
  static constexpr int nq = P::nq, nv = P::nv, nx = P::nx, ndx = P::ndx, nu = P::nu, nz = P::nz;

  CvodesStep()
      : cvodes_(
            nx, kCvodesTolerance, [this](double, const double* y, double* dy) { rate(y, dy); }, nz,
            [this](double, const double* y, int column, const double* s, double* ds) { sensitivity_rate(y, column, s, ds); }) {}

  // x_next = flow(x, u, h); AB: its derivative by (x, u), in tangents of x and x_next.
  void step(const double* x, const double* u, double h, double* x_next, Eigen::Matrix<double, ndx, nz>* AB) {
    std::copy(u, u + nu, u_);
    std::fill(y_, y_ + nx, NAN);
    std::copy(x, x + nx, x_next);
    Eigen::Matrix<double, nx, nz> s = Eigen::Matrix<double, nx, nz>::Zero();
    for (int j = 0; j < ndx; ++j) to_coordinates(x, Eigen::Matrix<double, ndx, 1>::Unit(j), s.col(j).data());
    const std::string wrong = cvodes_.advance(0.0, h, x_next, s.data());
    ASSERT_EQ(wrong, "");
    for (int j = 0; j < nz; ++j) AB->col(j) = to_tangent(x_next, s.col(j).data());
  }

 private:
  using Tangent = Eigen::Matrix<double, ndx, 1>;
  static Eigen::Quaterniond base(const double* x) { return Eigen::Quaterniond(x[6], x[3], x[4], x[5]).normalized(); }

  // Tangent (dq, dv) at x <-> its image in coordinates.
  static void to_coordinates(const double* x, const Tangent& d, double* s) {
    for (int i = 0; i < nv; ++i) s[nq + i] = d[nv + i];
    for (int i = P::kFreeBase ? 6 : 0; i < nv; ++i) s[nq - nv + i] = d[i];
    if constexpr (P::kFreeBase) {
      Eigen::Map<Eigen::Vector3d> p(s);
      p = base(x) * d.template head<3>();
      times_vector(x + 3, 0.5 * d.template segment<3>(3), s + 3);
    }
  }
  static Tangent to_tangent(const double* x, const double* s) {
    Tangent d;
    for (int i = 0; i < nv; ++i) d[nv + i] = s[nq + i];
    for (int i = P::kFreeBase ? 6 : 0; i < nv; ++i) d[i] = s[nq - nv + i];
    if constexpr (P::kFreeBase) {
      d.template head<3>() = base(x).conjugate() * Eigen::Vector3d(s[0], s[1], s[2]);
      const Eigen::Quaterniond turned(s[6], s[3], s[4], s[5]), turn = base(x).conjugate() * turned;
      d.template segment<3>(3) = 2.0 * turn.vec();
    }
    return d;
  }

  void rate(const double* y, double* dy) {
    double next[nx], cost;
    P::calc(knot(), y, u_, next, cost);
    Tangent d;
    for (int i = 0; i < nv; ++i) {
      d[i] = FirstOrder ? next[nq + i] : y[nq + i];
      d[nv + i] = FirstOrder ? 0.0 : next[nq + i] - y[nq + i];
    }
    to_coordinates(y, d, dy);
  }

  // With right tangents: (dq)' = dv - ad(v) dq. In coordinates the image of dq changes by itself as well:
  //   (R dp)' = R (dv_lin + dth x v_lin)      (quat dth / 2)' = quat' dth / 2 + quat (dv_ang - w x dth) / 2
  void sensitivity_rate(const double* y, int column, const double* s, double* ds) {
    if (!std::equal(y, y + nx, y_)) {  // the columns of one point share its model
      double next[nx], cost;
      P::linearize(knot(), y, u_, next, cost, model_);
      std::copy(y, y + nx, y_);
    }
    const Tangent d = to_tangent(y, s);
    Tangent out;
    for (int i = 0; i < nv; ++i) {
      double a = column >= ndx ? model_.D[i][padded_index<L>(column)] : 0.0;
      for (int j = 0; j < ndx; ++j) a += (model_.D[i][padded_index<L>(j)] - (!FirstOrder && j == nv + i ? 1.0 : 0.0)) * d[j];
      out[i] = FirstOrder ? a : d[nv + i];
      out[nv + i] = FirstOrder ? 0.0 : a;
    }
    if constexpr (P::kFreeBase) {
      const Eigen::Vector3d v(y[nq], y[nq + 1], y[nq + 2]), w(y[nq + 3], y[nq + 4], y[nq + 5]), dth = d.template segment<3>(3);
      out.template head<3>() += dth.cross(v);
      out.template segment<3>(3) -= w.cross(dth);
      to_coordinates(y, out, ds);
      double quat_rate[4], turning[4];
      times_vector(y + 3, 0.5 * w, quat_rate);
      times_vector(quat_rate, 0.5 * dth, turning);
      for (int i = 0; i < 4; ++i) ds[3 + i] += turning[i];
    } else {
      to_coordinates(y, out, ds);
    }
  }

  static typename P::template Knot<double> knot() {
    typename P::template Knot<double> k = {};
    k.dt = 1.0;
    return k;
  }

  sim::Cvodes cvodes_;
  double u_[nu] = {}, y_[nx] = {};
  typename P::template Model<double> model_;  // at (y_, u_)
};

// The discrete step's dense A and B from the structured model: dv' = D dz, dq' = E dq + dt G dv'.
template <class P> Eigen::Matrix<double, P::ndx, P::nz> dense_AB(const typename P::template Model<double>& M, double dt) {
  using L = typename P::Layout;
  constexpr int nv = P::nv, nz = P::nz;
  Eigen::Matrix<double, nv, nz> D;
  for (int i = 0; i < nv; ++i)
    for (int j = 0; j < nz; ++j) D(i, j) = M.D[i][padded_index<L>(j)];
  Eigen::Matrix<double, nv, nv> E = Eigen::Matrix<double, nv, nv>::Identity(), G = E;
  if constexpr (P::kFreeBase)
    for (int i = 0; i < 6; ++i)
      for (int j = 0; j < 6; ++j) E(i, j) = M.E(i, j), G(i, j) = M.G(i, j);
  Eigen::Matrix<double, P::ndx, nz> AB;
  AB.template bottomRows<nv>() = D;
  AB.template topRows<nv>() = dt * G * D;
  AB.template topLeftCorner<nv, nv>() += E;
  return AB;
}

}  // namespace engram
#endif  // TESTS_REFERENCE_CVODES_STEP_H_
