// Step 2 of an iteration: the Riccati sweep over the structure of the integrator.
//
// With dv' = D dz and dq' = E dq + dt G dv', the value function of the next knot is first written in (dq, dv'):
//   Vqq~ = E' Vqq E        Vvq~ = (dt G' Vqq + Vvq) E        Vvv~ = Vvv + dt (G' Vqv + Vvq G) + dt^2 G' Vqq G
//   vq~  = E' vq           vv~  = vv + dt G' vq
// and then pulled back through D alone:
//   Qzz = Lzz + [Vqq~ 0; 0 0] + D' Vvv~ D + D' [Vvq~ 0] + [Vvq~ 0]' D        Qz = Lz + [vq~; 0] + D' vv~
// Only lower triangles are formed. Then, with Quu + reg = L L':
//   Y = L^-1 Qux    K = L^-T Y    k = (L L')^-1 Qu    Vxx = Qxx - Y' Y    Vx = Qx - Qxu k + Vxx f
#ifndef CONTROLLER_FDDP_FDDP_BACKWARD_H_
#define CONTROLLER_FDDP_FDDP_BACKWARD_H_

#include "controller/fddp/fddp_box.h"
#include "controller/fddp/fddp_force_costs.h"
#include "controller/fddp/fddp_kernels.h"

#include <cmath>
#include <cstring>

namespace engram {

// M <- T' M: rows of the base block (6 x 6 T) of a matrix of n columns.
inline void base_rows(const Mat<double, 6, 6>& T, double* M, int ld, int n) {
  for (int j = 0; j < n; ++j) {
    double c[6];
    for (int i = 0; i < 6; ++i) {
      c[i] = 0.0;
      for (int k = 0; k < 6; ++k) c[i] += T(k, i) * M[k * ld + j];
    }
    for (int i = 0; i < 6; ++i) M[i * ld + j] = c[i];
  }
}

// M <- M T: columns of the base block of a matrix of m rows.
inline void base_columns(const Mat<double, 6, 6>& T, double* M, int ld, int m) {
  for (int i = 0; i < m; ++i) {
    double r[6];
    for (int j = 0; j < 6; ++j) {
      r[j] = 0.0;
      for (int k = 0; k < 6; ++k) r[j] += M[i * ld + k] * T(k, j);
    }
    for (int j = 0; j < 6; ++j) M[i * ld + j] = r[j];
  }
}

// The value function (w.Vxx, w.Vx) of the next knot in the coordinates (dq, dv'): fills w.Vqq, w.Vvq, w.Vvv and changes w.Vx.
template <class P, int N> void value_before_integrator(const typename FddpWork<P, N>::Model& m, double dt, FddpWork<P, N>& w) {
  using L = typename P::Layout;
  constexpr int nv = P::nv, nvp = padded(nv), ov = L::ov;
  for (int i = 0; i < nv; ++i) {
    std::memcpy(w.Vqq[i], w.Vxx[i], nvp * sizeof(double));           // Vqq
    std::memcpy(w.Vvv[i], w.Vxx[ov + i] + ov, nvp * sizeof(double));  // Vvv
    std::memcpy(w.B[i], w.Vxx[i] + ov, nvp * sizeof(double));         // Vqv
    std::memcpy(w.Vvq[i], w.Vxx[ov + i], nvp * sizeof(double));       // Vvq
  }
  if constexpr (P::kFreeBase) {
    base_rows(m.G, &w.Vqq[0][0], nvp, nvp);  // G' Vqq
    base_rows(m.G, &w.B[0][0], nvp, nvp);    // G' Vqv
  }
  for (int i = 0; i < nv; ++i)
    for (int j = 0; j < nvp; ++j) {
      w.Vvq[i][j] += dt * w.Vqq[i][j];  // dt G' Vqq + Vvq
      w.Vvv[i][j] += dt * w.B[i][j];    // Vvv + dt G' Vqv
    }
  if constexpr (P::kFreeBase) {  // + dt (dt G' Vqq + Vvq) G, then Vvq E and E' Vqq E
    std::memcpy(w.B, w.Vvq, sizeof(w.B));
    base_columns(m.G, &w.B[0][0], nvp, nv);
    for (int i = 0; i < nv; ++i)
      for (int j = 0; j < nvp; ++j) w.Vvv[i][j] += dt * w.B[i][j];
    base_columns(m.E, &w.Vvq[0][0], nvp, nv);
    for (int i = 0; i < nv; ++i) std::memcpy(w.Vqq[i], w.Vxx[i], nvp * sizeof(double));
    base_rows(m.E, &w.Vqq[0][0], nvp, nvp);
    base_columns(m.E, &w.Vqq[0][0], nvp, nv);
    double g[6], e[6];
    for (int i = 0; i < 6; ++i) {
      g[i] = e[i] = 0.0;
      for (int k = 0; k < 6; ++k) {
        g[i] += m.G(k, i) * w.Vx[k];
        e[i] += m.E(k, i) * w.Vx[k];
      }
    }
    for (int i = 0; i < nv; ++i) w.Vx[ov + i] += dt * (i < 6 ? g[i] : w.Vx[i]);
    for (int i = 0; i < 6; ++i) w.Vx[i] = e[i];
  } else {
    for (int i = 0; i < nv; ++i)
      for (int j = 0; j < nvp; ++j) w.Vvv[i][j] += dt * w.Vvq[i][j];
    for (int i = 0; i < nv; ++i) w.Vx[ov + i] += dt * w.Vx[i];
  }
}

// Qzz (lower) and Qz of a knot from its model and the value function in (dq, dv').
template <class P, int N> void action_value(const typename FddpWork<P, N>::Model& m, FddpWork<P, N>& w) {
  using L = typename P::Layout;
  constexpr int nv = P::nv, nvp = padded(nv), nzp = L::nzp, ov = L::ov;
  std::memset(w.W, 0, sizeof(w.W));
  kernel::product<nv, nzp, nv>(&w.Vvv[0][0], nvp, &m.D[0][0], nzp, &w.W[0][0], nzp);  // W = Vvv~ D
  for (int i = 0; i < nv; ++i)
    for (int j = 0; j < nvp; ++j) {
      const double half = 0.5 * w.W[i][j];
      w.W[i][j] += w.Vvq[i][j];    // W = Vvv~ D + [Vvq~ 0], for the rows v and u of Qzz
      w.Vvq[i][j] += half;         // 1/2 Vvv~ Dq + Vvq~, for its block qq
    }
  std::memset(w.B, 0, sizeof(w.B));
  kernel::product<nv, nvp, nv>(&m.D[0][0], nzp, &w.Vvq[0][0], nvp, &w.B[0][0], nvp);  // B = Dq' (1/2 Vvv~ Dq + Vvq~)
  copy_hessian(m, nzp, w.Q);
  for (int i = 0; i < nv; ++i)
    for (int j = 0; j <= i; ++j) w.Q[i][j] += w.Vqq[i][j] + (w.B[i][j] + w.B[j][i]);
  kernel::product_lower<nzp, nv, kernel::Sign::kPlus, ov>(&m.D[0][0], nzp, &w.W[0][0], nzp, &w.Q[0][0], nzp);
  if constexpr (P::kPhases) add_force_hessian<P, N>(m, w);
  std::memcpy(w.Qz, m.Lz, sizeof(w.Qz));
  for (int i = 0; i < nv; ++i) w.Qz[i] += w.Vx[i];
  kernel::product_vector<nzp, nv>(&m.D[0][0], nzp, w.Vx + ov, w.Qz);
}

// Gains of knot k from (w.Q, w.Qz), and the value function before it. False if Quu + reg is not positive definite.
template <class P, int N> bool gains(int k, const FddpOpts& opts, FddpWork<P, N>& w, FddpSolution<P, N>& s) {
  using L = typename P::Layout;
  constexpr int nu = P::nu, nxp = L::nxp, nup = L::nup, ou = L::ou;
  double inv[nup];
  double* const Qu = w.Qz + ou;
  for (int i = 0; i < nu; ++i) {
    w.Q[ou + i][ou + i] += w.reg;
    std::memcpy(w.Luu[i], w.Q[ou + i] + ou, nup * sizeof(double));
    std::memcpy(w.Y[i], w.Q[ou + i], nxp * sizeof(double));
  }
  double gain1 = 0.0, gain2 = 0.0;  // k' Qu and k' Quu k
  if (opts.box) {
    if (!fddp_box(s.u[k], w, inv, w.k[k])) return false;
    for (int i = 0; i < nu; ++i) {
      double Quuk = 0.0;
      for (int j = 0; j < nu; ++j) Quuk += (j <= i ? w.Q[ou + i][ou + j] : w.Q[ou + j][ou + i]) * w.k[k][j];
      gain1 += w.k[k][i] * Qu[i];
      gain2 += w.k[k][i] * Quuk;
    }
  } else {
    if (!kernel::cholesky<nu>(&w.Luu[0][0], nup, inv)) return false;
    double y[nup];
    for (int i = 0; i < nu; ++i) {  // y = L^-1 Qu
      y[i] = Qu[i];
      for (int j = 0; j < i; ++j) y[i] -= w.Luu[i][j] * y[j];
      y[i] *= inv[i];
      gain1 += y[i] * y[i];
    }
    gain2 = gain1;
    for (int i = nu - 1; i >= 0; --i) {  // k = L^-T y
      for (int j = i + 1; j < nu; ++j) y[i] -= w.Luu[j][i] * y[j];
      y[i] *= inv[i];
      w.k[k][i] = y[i];
    }
  }
  kernel::product_vector<nxp, nu, kernel::Sign::kMinus>(w.Q[ou], L::nzp, w.k[k], w.Qz);  // Vx = Qx - Qxu k
  kernel::solve_lower<nu, nxp>(&w.Luu[0][0], nup, inv, &w.Y[0][0], nxp);                // Y = L^-1 Qux
  std::memcpy(s.K[k], w.Y, sizeof(w.Y));
  kernel::solve_lower_transposed<nu, nxp>(&w.Luu[0][0], nup, inv, &s.K[k][0][0], nxp);  // K = L^-T Y
  for (int i = 0; i < nxp; ++i) std::memcpy(w.Vxx[i], w.Q[i], padded(i + 1) * sizeof(double));
  kernel::product_lower<nxp, nu, kernel::Sign::kMinus>(&w.Y[0][0], nxp, &w.Y[0][0], nxp, &w.Vxx[0][0], nxp);  // Qxx - Y' Y
  std::memcpy(w.Vx, w.Qz, sizeof(w.Vx));
  w.dg += gain1;
  w.dq -= gain2;
  return true;
}

// What the gap of knot k adds to the value gradient and to the expected improvement.
template <class P, int N> void close_gap(int k, FddpWork<P, N>& w) {
  using L = typename P::Layout;
  kernel::symmetric_vector<L::nxp>(&w.Vxx[0][0], L::nxp, w.f[k], w.Vf[k]);
  for (int i = 0; i < L::nxp; ++i) {
    w.Vx[i] += w.Vf[k][i];
    w.dg -= w.Vx[i] * w.f[k][i];
    w.dq += w.f[k][i] * w.Vf[k][i];
  }
}

// Vxx <- full symmetric Vxx + reg I.
template <class P, int N> void close_value(FddpWork<P, N>& w) {
  using L = typename P::Layout;
  kernel::mirror_lower<L::nxp>(&w.Vxx[0][0], L::nxp);
  for (int i = 0; i < L::ndx; ++i) w.Vxx[padded_index<L>(i)][padded_index<L>(i)] += w.reg;
}

// Fills w.k, w.Vf, w.dg, w.dq and s.K. False if the regularization is too small for a descent direction.
template <class P, int N>
bool fddp_backward(const Horizon<P, N>& h, const FddpOpts& opts, FddpWork<P, N>& w, FddpSolution<P, N>& s) {
  using L = typename P::Layout;
  w.dg = w.dq = 0.0;
  copy_hessian(w.model[h.n], L::nxp, w.Vxx);
  std::memcpy(w.Vx, w.model[h.n].Lz, sizeof(w.Vx));
  close_value(w);
  for (int k = h.n - 1; k >= 0; --k) {
    close_gap(k + 1, w);
    value_before_integrator<P, N>(w.model[k], h.knot[k].dt, w);
    action_value<P, N>(w.model[k], w);
    if (!gains(k, opts, w, s)) return false;
    close_value(w);
  }
  std::memcpy(w.Vx0, w.Vx, sizeof(w.Vx0));
  w.dg0 = w.dg;
  w.dq0 = w.dq;
  close_gap(0, w);
  return std::isfinite(w.dg) && std::isfinite(w.dq);
}

}  // namespace engram
#endif  // CONTROLLER_FDDP_FDDP_BACKWARD_H_
