// A knot of the optimal control problem of a system that is a formula, without a robot's tree: q'' = a(q, v, u) in R^n.
//
//   v' = v + dt a(q, v, u),  q' = q + dt v'      as ocp.h
//   l  = 1/2 sum w_x (x - x_ref)^2 + 1/2 sum w_u (u - u_ref)^2     (weights carry the factor dt)
//
// A System has n, nu, u_lo[nu], u_hi[nu] and `step`: v' as a formula over any scalar. Its derivatives come from the same formula
// (ocp_dual.h). A system of first order, q' = q + dt f(q, u), states v' = f(q, u): its v remembers the last rate and moves nothing.
#ifndef CONTROLLER_OCP_OCP_ANALYTIC_H_
#define CONTROLLER_OCP_OCP_ANALYTIC_H_

#include "controller/ocp/ocp_dual.h"
#include "controller/ocp/ocp_knot_model.h"

namespace engram {

template <class System_> struct AnalyticOcp {
  using System = System_;
  static constexpr int nq = System::n, nv = System::n, nx = 2 * nv, ndx = 2 * nv, nu = System::nu, nz = ndx + nu;
  using Layout = KnotLayout<nv, nu>;
  template <class S> using Model = KnotModel<Layout, false, S>;
  using LqModel = Model<Real>;
  using Lanes = Model<Pack>;
  static constexpr bool kPhases = false, kFreeBase = false;
  template <class S> struct Knot {
    S w_x[ndx], x_ref[nx];  // of (q, v)
    S w_u[nu], u_ref[nu];
    S dt;  // time step [s]; 0 at the terminal knot
  };

  static constexpr Real u_lo(int i) { return System::u_lo[i]; }
  static constexpr Real u_hi(int i) { return System::u_hi[i]; }

  // x_next = x + dx, dx padded
  template <class S> static void integrate(const S* x, const S* dx, S* x_next) {
    for (int i = 0; i < nx; ++i) x_next[i] = x[i] + dx[padded_index<Layout>(i)];
  }

  // dx = x1 - x0, padded; the padding is set to zero
  template <class S> static void difference(const S* x0, const S* x1, S* dx) {
    for (int i = 0; i < Layout::nxp; ++i) dx[i] = 0.0;
    for (int i = 0; i < nx; ++i) dx[padded_index<Layout>(i)] = x1[i] - x0[i];
  }

  // Next state and cost of a knot.
  template <class S> static void calc(const Knot<S>& knot, const S* x, const S* u, S* x_next, S& cost) {
    System::step(knot.dt, x, x + nq, u, x_next + nq);
    for (int i = 0; i < nq; ++i) x_next[i] = x[i] + knot.dt * x_next[nq + i];
    cost = cost_of(knot, x, u);
  }

  // Cost of the terminal knot: no control.
  template <class S> static void calc_terminal(const Knot<S>& knot, const S* x, S& cost) { cost = cost_of(knot, x, knot.u_ref); }

  // Next state, cost and linear-quadratic model of a knot.
  template <class S> static void linearize(const Knot<S>& knot, const S* x, const S* u, S* x_next, S& cost, Model<S>& M) {
    using D = Dual<S, nz>;
    D z[nz], v_next[nv], dt(0.0);
    dt.value = knot.dt;
    for (int i = 0; i < nx; ++i) z[i] = D(x[i], i);
    for (int i = 0; i < nu; ++i) z[ndx + i] = D(u[i], ndx + i);
    System::step(dt, z, z + nq, z + ndx, v_next);
    for (int i = 0; i < nv; ++i) {
      x_next[nq + i] = v_next[i].value;
      x_next[i] = x[i] + knot.dt * x_next[nq + i];
      for (int j = 0; j < Layout::nzp; ++j) M.D[i][j] = 0.0;
      for (int j = 0; j < nz; ++j) M.D[i][padded_index<Layout>(j)] = v_next[i].d[j];
    }
    for (int i = 0; i < Layout::nzp; ++i) {
      M.Lz[i] = 0.0;
      for (int j = 0; j < Layout::nzp; ++j) M.Lzz[i][j] = 0.0;
    }
    for (int i = 0; i < nz; ++i) {
      const int p = padded_index<Layout>(i);
      const S w = i < ndx ? knot.w_x[i] : knot.w_u[i - ndx];
      M.Lz[p] = w * (i < ndx ? x[i] - knot.x_ref[i] : u[i - ndx] - knot.u_ref[i - ndx]);
      M.Lzz[p][p] = w;
    }
    cost = cost_of(knot, x, u);
  }

 private:
  template <class S> static S cost_of(const Knot<S>& knot, const S* x, const S* u) {
    S sum = 0.0;
    for (int i = 0; i < ndx; ++i) sum += knot.w_x[i] * (x[i] - knot.x_ref[i]) * (x[i] - knot.x_ref[i]);
    for (int i = 0; i < nu; ++i) sum += knot.w_u[i] * (u[i] - knot.u_ref[i]) * (u[i] - knot.u_ref[i]);
    return S(0.5) * sum;
  }
};

}  // namespace engram
#endif  // CONTROLLER_OCP_OCP_ANALYTIC_H_
