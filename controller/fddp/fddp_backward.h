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

// Products with the base block T (6 x 6) of the integrator, of rows that start at a vector boundary: the columns beyond 6 of a vector
// pass through an identity.
class BaseColumns {
 public:
  explicit BaseColumns(const Mat<Real, 6, 6>& T) {
    for (int i = 0; i < kWidth; ++i)
      for (int j = 0; j < kWidth; ++j) T_[i][j] = i < 6 && j < 6 ? T(i, j) : i == j ? 1.0 : 0.0;
  }
  // row <- row T
  void apply(Real* row) const {
    kernel::Vector c[kWidth / kVector] = {};
    for (int k = 0; k < kWidth; ++k)
      for (int j = 0; j < kWidth / kVector; ++j) c[j] += row[k] * kernel::vec(T_[k] + j * kVector);
    for (int j = 0; j < kWidth / kVector; ++j) kernel::vec(row + j * kVector) = c[j];
  }

 private:
  static constexpr int kWidth = 8;
  alignas(64) Real T_[kWidth][kWidth];
};

// out (6 rows of n, apart) = T' M for the first 6 rows of M.
template <int n> inline void base_rows(const Mat<Real, 6, 6>& T, const Real* M, int ldm, Real* out, int ldo) {
  Real columns[6][6];
  for (int k = 0; k < 6; ++k)
    for (int i = 0; i < 6; ++i) columns[k][i] = T(k, i);
  kernel::product<6, n, 6, kernel::Sign::kPlus, kernel::Start::kSet>(&columns[0][0], 6, M, ldm, out, ldo);
}

// The value function (w.Vxx, w.Vx) of the next knot in the coordinates (dq, dv'): fills w.Vqq (lower), w.Vvq, w.Vvv and changes w.Vx.
template <class P, int N> void value_before_integrator(const typename FddpWork<P, N>::Model& m, Real dt, FddpWork<P, N>& w) {
  using L = typename P::Layout;
  constexpr int nv = P::nv, nvp = padded(nv), ov = L::ov, nxp = L::nxp;
  using kernel::vec;
  if constexpr (P::kFreeBase) {
    const BaseColumns E(m.E), G(m.G);
    base_rows<nxp>(m.G, &w.Vxx[0][0], nxp, &w.GV[0][0], nxp);  // G' (Vqq Vqv)
    for (int i = 0; i < nv; ++i) {
      const Real* const q = i < 6 ? w.GV[i] : w.Vxx[i];
      Real *const vq = w.Vvq[i], *const vv = w.Vvv[i];
      for (int j = 0; j < nvp; j += kVector) {
        vec(vq + j) = vec(w.Vxx[ov + i] + j) + dt * vec(q + j);            // Vvq + dt G' Vqq
        vec(vv + j) = vec(w.Vxx[ov + i] + ov + j) + dt * vec(q + ov + j);  // Vvv + dt G' Vqv
      }
      alignas(64) Real head[8];  // + dt (dt G' Vqq + Vvq) G
      std::memcpy(head, vq, sizeof(head));
      G.apply(head);
      for (int j = 0; j < 8; j += kVector) vec(vv + j) += dt * vec(head + j);
      for (int j = 8; j < nvp; j += kVector) vec(vv + j) += dt * vec(vq + j);
      E.apply(vq);
    }
    base_rows<nvp>(m.E, &w.Vxx[0][0], nxp, &w.Vqq[0][0], nvp);  // E' Vqq E
    for (int i = 6; i < nv; ++i) copy_row(w.Vqq[i], w.Vxx[i], nvp);
    for (int i = 0; i < nv; ++i) E.apply(w.Vqq[i]);
    Real g[6], e[6];
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
      for (int j = 0; j < nvp; j += kVector) {
        vec(w.Vqq[i] + j) = vec(w.Vxx[i] + j);
        vec(w.Vvq[i] + j) = vec(w.Vxx[ov + i] + j) + dt * vec(w.Vxx[i] + j);
        vec(w.Vvv[i] + j) = vec(w.Vxx[ov + i] + ov + j) + dt * vec(w.Vxx[i] + ov + j) + dt * vec(w.Vvq[i] + j);
      }
    for (int i = 0; i < nv; ++i) w.Vx[ov + i] += dt * w.Vx[i];
  }
}

// Qzz (lower) and Qz of a knot from its model and the value function in (dq, dv').
template <class P, int N> void action_value(const typename FddpWork<P, N>::Model& m, FddpWork<P, N>& w) {
  using L = typename P::Layout;
  using kernel::Sign;
  using kernel::Start;
  using kernel::vec;
  constexpr int nv = P::nv, nvp = padded(nv), nzp = L::nzp, ov = L::ov;
  kernel::product<nv, nzp, nv, Sign::kPlus, Start::kSet>(&w.Vvv[0][0], nvp, &m.D[0][0], nzp, &w.W[0][0], nzp);  // W = Vvv~ D
  for (int i = 0; i < nv; ++i)
    for (int j = 0; j < nvp; j += kVector) {
      const kernel::Vector half = Real(0.5) * vec(w.W[i] + j);
      vec(w.W[i] + j) += vec(w.Vvq[i] + j);  // W = Vvv~ D + [Vvq~ 0], for the rows v and u of Qzz
      vec(w.Vvq[i] + j) += half;             // 1/2 Vvv~ Dq + Vvq~, for its block qq
    }
  // block qq: Hessian + Vqq~ + Dq' (1/2 Vvv~ Dq + Vvq~) + (1/2 Vvv~ Dq + Vvq~)' Dq
  copy_hessian_qq(m, w.Q);
  for (int i = 0; i < nv; ++i)
    for (int j = 0; j <= i; j += kVector) vec(w.Q[i] + j) += vec(w.Vqq[i] + j);
  kernel::product_lower<nv, nv>(&m.D[0][0], nzp, &w.Vvq[0][0], nvp, &w.Q[0][0], nzp);
  kernel::product_lower<nv, nv>(&w.Vvq[0][0], nvp, &m.D[0][0], nzp, &w.Q[0][0], nzp);
  // rows v and u: Hessian + D' W
  if constexpr (kDiagonalHessian<typename FddpWork<P, N>::Model>) {
    kernel::product_lower<nzp, nv, Sign::kPlus, ov, Start::kSet>(&m.D[0][0], nzp, &w.W[0][0], nzp, &w.Q[0][0], nzp);
    for (int i = ov; i < nzp; ++i) w.Q[i][i] += m.h[i];
    add_force_hessian<P, N>(m, w);
    add_coupled_hessian<nzp>(m, w.Q);
  } else {
    for (int i = ov; i < nzp; ++i) copy_row(w.Q[i], m.Lzz[i], padded(i + 1));
    kernel::product_lower<nzp, nv, Sign::kPlus, ov>(&m.D[0][0], nzp, &w.W[0][0], nzp, &w.Q[0][0], nzp);
  }
  std::memcpy(w.Qz, m.Lz, sizeof(w.Qz));
  for (int i = 0; i < nv; ++i) w.Qz[i] += w.Vx[i];
  kernel::product_vector<nzp, nv>(&m.D[0][0], nzp, w.Vx + ov, w.Qz);
}

// Gains of knot k from (w.Q, w.Qz), and the value function before it. False if Quu + reg is not positive definite.
template <class P, int N> bool gains(int k, const FddpOpts& opts, FddpWork<P, N>& w, FddpSolution<P, N>& s) {
  using L = typename P::Layout;
  constexpr int nu = P::nu, nxp = L::nxp, nup = L::nup, ou = L::ou;
  Real inv[nup];
  Real* const Qu = w.Qz + ou;
  for (int i = 0; i < nu; ++i) {
    w.Q[ou + i][ou + i] += w.reg;
    std::memcpy(w.Luu[i], w.Q[ou + i] + ou, nup * sizeof(Real));
    std::memcpy(w.Y[i], w.Q[ou + i], nxp * sizeof(Real));
  }
  Real gain1 = 0.0, gain2 = 0.0;  // k' Qu and k' Quu k
  for (int i = 0; i < nu; ++i) w.gradient += Qu[i] * Qu[i];
  if (opts.box) {
    if (!fddp_box(s.u[k], w, inv, w.k[k])) return false;
    for (int i = 0; i < nu; ++i) {
      Real Quuk = 0.0;
      for (int j = 0; j < nu; ++j) Quuk += (j <= i ? w.Q[ou + i][ou + j] : w.Q[ou + j][ou + i]) * w.k[k][j];
      gain1 += w.k[k][i] * Qu[i];
      gain2 += w.k[k][i] * Quuk;
    }
  } else {
    if (!kernel::cholesky<nu>(&w.Luu[0][0], nup, inv)) return false;
    Real* const y = w.k[k];  // k = L^-T L^-1 Qu
    std::memcpy(y, Qu, nup * sizeof(Real));
    kernel::solve_lower_vector<nu>(&w.Luu[0][0], nup, inv, y);
    for (int i = 0; i < nu; ++i) gain1 += y[i] * y[i];
    gain2 = gain1;
    kernel::solve_lower_transposed_vector<nu>(&w.Luu[0][0], nup, inv, y);
  }
  kernel::product_vector<nxp, nu, kernel::Sign::kMinus>(w.Q[ou], L::nzp, w.k[k], w.Qz);  // Vx = Qx - Qxu k
  kernel::solve_lower<nu, nxp>(&w.Luu[0][0], nup, inv, &w.Y[0][0], nxp);                // Y = L^-1 Qux
  copy_row(s.K[k][0], w.Y[0], nu * nxp);
  kernel::solve_lower_transposed<nu, nxp>(&w.Luu[0][0], nup, inv, &s.K[k][0][0], nxp);  // K = L^-T Y
  for (int i = 0; i < nxp; ++i) copy_row(w.Vxx[i], w.Q[i], padded(i + 1));
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

// Fills w.k, w.Vf, w.dg, w.dq, w.gradient and s.K. False if the regularization is too small for a descent direction.
template <class P, int N>
bool fddp_backward(const Horizon<P, N>& h, const FddpOpts& opts, FddpWork<P, N>& w, FddpSolution<P, N>& s) {
  w.dg = w.dq = w.gradient = 0.0;
  copy_hessian_x(w.model[h.n], w.Vxx);
  if constexpr (P::kPhases) add_coupled_hessian<P::Layout::nxp>(w.model[h.n], w.Vxx);
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
