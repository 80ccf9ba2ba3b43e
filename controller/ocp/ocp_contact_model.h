// The linear-quadratic model of a knot with contacts, and its last, dense step, a knot at a time.
//
//   dv' = D dz,  dq' = E dq + dt G dv'                 as in ocp_knot_model.h
//   dlambda = F dz                                     contact forces, world axes at each contact
//   l ~ l0 + Lz' dz + 1/2 dz' (Hqq + diag(h) + F' H F + T' T) dz
//
// Costs touch few coordinates: those of the state couple q with q, those of forces come through F, and residuals that couple more leave
// their rows T. The full Hessian is never stored.
#ifndef CONTROLLER_OCP_OCP_CONTACT_MODEL_H_
#define CONTROLLER_OCP_OCP_CONTACT_MODEL_H_

#include "controller/ocp/ocp_actuation.h"
#include "controller/ocp/ocp_dense_rows.h"
#include "controller/ocp/ocp_residual.h"
#include "controller/rbd/rbd_contact_derivatives.h"

#include <cmath>
#include <cstring>
#include <utility>

namespace engram {

// Rows of coupled residuals, times the root of their weights; nothing if there are none.
template <class L, int nt> struct CoupledModel {
  alignas(64) Real T[nt][L::nzp];
  bool coupled;  // false: all rows are zero
};
template <class L> struct CoupledModel<L, 0> {};

template <class C, int nt_ = 0>
struct ContactKnotModel : BaseBlock<kFreeBase<typename C::Robot>, Real>, CoupledModel<LayoutOf<typename C::Robot>, nt_> {
  using R = typename C::Robot;
  using L = LayoutOf<R>;
  static constexpr int nf = kContactRows<C>, nt = nt_;
  alignas(64) Real D[R::nv][L::nzp];               // d v' / d z                              (nv x nz)
  alignas(64) Real F[nf][L::nzp];                  // d lambda / d z, rows of active contacts, axes of the set (nf x nz)
  alignas(64) Real Lz[L::nzp];                     // d l / d z                               (nz)
  alignas(64) Real Hqq[R::nv][padded(R::nv)];      // lower triangle
  alignas(64) Real h[L::nzp];                      // diagonal
  Real H[C::n][6][6];                              // Hessian of the force costs of each contact
  unsigned forces;                                 // contacts whose H is not zero: bit c for contact c

  // Entry i >= j of the Hessian, padded indices: for tests and comparisons.
  Real hessian(int i, int j) const {
    Real s = (i < R::nv && j < R::nv ? Hqq[i][j] : 0.0) + (i == j ? h[i] : 0.0);
    for (int c = 0; c < C::n; ++c) {
      if (!contact_active(forces, c)) continue;
      const int first = kContactTree<C>.first[c], rows = kContactTree<C>.rows[c];
      for (int r = 0; r < rows; ++r)
        for (int t = 0; t < rows; ++t) s += F[first + r][i] * H[c][r][t] * F[first + t][j];
    }
    if constexpr (nt > 0)
      for (const auto& row : this->T) s += row[i] * row[j];
    return s;
  }
};

// The stored Hessian, as for a knot without contacts: block qq, and all blocks of the state.
template <class C, int nt, int ld> inline void copy_hessian_qq(const ContactKnotModel<C, nt>& m, Real (*to)[ld]) {
  for (int i = 0; i < C::Robot::nv; ++i) copy_row(to[i], m.Hqq[i], padded(i + 1));
}
template <class C, int nt, int ld> inline void copy_hessian_x(const ContactKnotModel<C, nt>& m, Real (*to)[ld]) {
  constexpr int nv = C::Robot::nv;
  copy_hessian_qq(m, to);
  for (int i = nv; i < LayoutOf<typename C::Robot>::nxp; ++i) {
    std::memset(to[i], 0, padded(i + 1) * sizeof(Real));
    to[i][i] = m.h[i];
  }
}
template <class C, int nt> inline constexpr bool kDiagonalHessian<ContactKnotModel<C, nt>> = true;

// Calls f(c) for every contact of C, active or not, c a compile-time constant.
template <class C, class F, int... c> inline void for_contact(F f, std::integer_sequence<int, c...>) {
  (f(std::integral_constant<int, c>{}), ...);
}
template <class C, class F> inline void for_contact(F f) { for_contact<C>(f, std::make_integer_sequence<int, C::n>{}); }

// What the lanes of kLanes knots (S = Pack) leave for the dense step.
template <class R, int nf, int nt, class S> struct CoupledLanes {
  CoupledRow<R, nf, S> row[nt];
};
template <class R, int nf, class S> struct CoupledLanes<R, nf, 0, S> {};

template <class C, int nt, class S> struct ContactLanes : CoupledLanes<typename C::Robot, kContactRows<C>, nt, S> {
  using R = typename C::Robot;
  RbdData<R, S> d;
  ContactData<C, S> cd;
  ContactDerivatives<C, R::nu, S> x;
  ModelOf<R, S> cost;              // base blocks, gradient and Hessian of the costs of state and control
  S g[kContactRows<C>];            // gradient of the force costs
  S H[C::n][6][6];                 // their Hessian
};

// m.F, so far seen from axes that move with the contacts' bodies and point as the world's, in the axes of the set.
template <class C, int nt>
inline void contact_finish_forces(const ContactData<C, Pack>& cd, int lane, unsigned active, ContactKnotModel<C, nt>& m) {
  using L = LayoutOf<typename C::Robot>;
  constexpr const ContactTree<C>& tree = kContactTree<C>;
  for (int c = 0; c < C::n; ++c) {
    if (!contact_active(active, c)) continue;
    const int first = tree.first[c];
    if constexpr (kContactAxes<C> == Axes::kLocal) {
      for (int part = first; part < tree.first[c + 1]; part += 3)
        for (int z = 0; z < L::nzp; ++z) {
          const Real f[3] = {m.F[part][z], m.F[part + 1][z], m.F[part + 2][z]};
          for (int i = 0; i < 3; ++i)
            m.F[part + i][z] = cd.R_WF[c](0, i).l[lane] * f[0] + cd.R_WF[c](1, i).l[lane] * f[1] + cd.R_WF[c](2, i).l[lane] * f[2];
        }
      continue;
    }
    // forces turn with the world's axes, not with the body: + w_k x lambda
    for (int part = first; part < tree.first[c + 1]; part += 3)
      for (int a = 0; a < tree.path_n[c]; ++a) {
        const int k = L::oq + tree.path[c][a];
        const Vec3<Pack>&w = cd.J[c][a].ang, l(cd.lambda[part], cd.lambda[part + 1], cd.lambda[part + 2]);
        for (int i = 0; i < 3; ++i) {
          const int i1 = (i + 1) % 3, i2 = (i + 2) % 3;
          m.F[part + i][k] += w[i1].l[lane] * l[i2].l[lane] - w[i2].l[lane] * l[i1].l[lane];
        }
      }
  }
}

// m.T of the rows of coupled residuals, and their share of m.Lz.
template <class C, int nt>
inline void contact_finish_rows(const ContactLanes<C, nt, Pack>& in, int lane, unsigned active, ContactKnotModel<C, nt>& m) {
  using L = LayoutOf<typename C::Robot>;
  constexpr int nv = C::Robot::nv, nf = kContactRows<C>;
  const ActiveRows<C> rows(active);
  m.coupled = false;
  for (int t = 0; t < nt; ++t) {
    const auto& row = in.row[t];
    const Real w = std::sqrt(row.w.l[lane]);
    std::memset(m.T[t], 0, sizeof(m.T[t]));
    if (w == 0.0) continue;
    m.coupled = true;
    for (int k = 0; k < nv; ++k) {
      m.T[t][L::oq + k] = row.q[k].l[lane];
      m.T[t][L::ov + k] = row.v[k].l[lane];
    }
    Real coefficient[nf] = {};
    const Real* from[nf] = {};
    int n = 0;
    for (int r = 0; r < rows.n; ++r) {
      const Real a = row.lambda[rows.row[r]].l[lane];
      if (a == 0.0) continue;
      coefficient[n] = a;
      from[n++] = m.F[rows.row[r]];
    }
    dense_rows::combine<L::nzp>(m.T[t], n, coefficient, from, w);
    for (int z = 0; z < L::nzp; ++z) m.Lz[z] += w * row.e.l[lane] * m.T[t][z];
  }
}

// Fills D, F, E and G of the model of one lane. step: dt of a knot in time, 1 of an impact.
template <class C, int nt>
inline void contact_finish_dynamics(const ContactLanes<C, nt, Pack>& in, int lane, unsigned active, Real step, ContactKnotModel<C, nt>& m) {
  using R = typename C::Robot;
  using L = LayoutOf<R>;
  constexpr const ContactTree<C>& tree = kContactTree<C>;
  constexpr int nv = R::nv, nu = R::nu, nzp = L::nzp, nf = kContactRows<C>;
  const ActiveRows<C> rows(active);
  Real coefficient[nf + nv] = {};
  const Real* row[nf + nv] = {};

  // F = G^-1 B
  for (int I = 0; I < rows.n; ++I) {
    const int r = rows.row[I];
    Real* const f = m.F[r];
    std::memset(f, 0, sizeof(m.F[r]));
    for (int k = 0; k < nv; ++k) f[L::oq + k] = in.x.Bq[r][k].l[lane];
    for (int k = 0; k < nv; ++k) f[L::ov + k] = in.x.Bv[r][k].l[lane];
    for (int k = 0; k < nu; ++k) f[L::ou + k] = in.x.Bu[r][k].l[lane];
    for (int K = 0; K < I; ++K) {
      coefficient[K] = -in.cd.G[r][rows.row[K]].l[lane];
      row[K] = m.F[rows.row[K]];
    }
    dense_rows::combine<nzp>(f, I, coefficient, row, in.cd.G_inv[r].l[lane]);
  }
  for (int I = rows.n - 1; I >= 0; --I) {
    int n = 0;
    for (int K = I + 1; K < rows.n; ++K, ++n) {
      coefficient[n] = -in.cd.G[rows.row[K]][rows.row[I]].l[lane];
      row[n] = m.F[rows.row[K]];
    }
    dense_rows::combine<nzp>(m.F[rows.row[I]], n, coefficient, row, in.cd.G_inv[rows.row[I]].l[lane]);
  }

  // step L^-1 (U F - D^-1 X), row by row from the root
  for (int k = 0; k < nv; ++k) {
    Real* const out = m.D[k];
    std::memset(out, 0, sizeof(m.D[k]));
    const Real scale = -step * in.d.D_inv[k].l[lane];
    const auto copy = [&](int j) {
      out[L::oq + j] = scale * in.x.Xq(k, j).l[lane];
      out[L::ov + j] = scale * in.x.Xv(k, j).l[lane];
    };
    for (int j = kTree<R>.parent[k]; j >= 0; j = kTree<R>.parent[j]) copy(j);
    for (int j = k; j < kTree<R>.end[k]; ++j) copy(j);
    for (int j = 0; j < nu; ++j)
      if (const int dof = Actuation<R>::dof(j); dof < 0 || (dof >= k && dof < kTree<R>.end[k])) out[L::ou + j] = scale * in.x.Xu[k][j].l[lane];
    int n = 0;
    for (int c = 0; c < C::n; ++c) {
      if (!contact_active(active, c) || !tree.moves(k, c)) continue;
      for (int r = 0; r < tree.rows[c]; ++r, ++n) {
        coefficient[n] = step * in.cd.U[c][tree.shared[c][k] - 1][r].l[lane];
        row[n] = m.F[tree.first[c] + r];
      }
    }
    for (int j = kTree<R>.parent[k]; j >= 0; j = kTree<R>.parent[j], ++n) {
      coefficient[n] = -in.d.L(k, j).l[lane];
      row[n] = m.D[j];
    }
    dense_rows::combine<nzp>(out, n, coefficient, row, 1.0);
  }
  for (int k = 0; k < nv; ++k) m.D[k][L::ov + k] += 1.0;

  contact_finish_forces(in.cd, lane, active, m);

  if constexpr (kFreeBase<R>)
    for (int i = 0; i < 36; ++i) {
      m.E.data()[i] = in.cost.E.data()[i].l[lane];
      m.G.data()[i] = in.cost.G.data()[i].l[lane];
    }
}

// Fills the costs of the model of one lane, those of the forces for active contacts. After contact_finish_dynamics if any is active.
template <class C, int nt>
inline void contact_finish_costs(const ContactLanes<C, nt, Pack>& in, int lane, unsigned active, ContactKnotModel<C, nt>& m) {
  using R = typename C::Robot;
  using L = LayoutOf<R>;
  constexpr const ContactTree<C>& tree = kContactTree<C>;
  constexpr int nv = R::nv, nzp = L::nzp;
  for (int i = 0; i < nzp; ++i) {
    m.Lz[i] = in.cost.Lz[i].l[lane];
    m.h[i] = i < nv ? 0.0 : in.cost.Lzz[i][i].l[lane];
  }
  for (int i = 0; i < nv; ++i)
    for (int j = 0; j < padded(i + 1); ++j) m.Hqq[i][j] = j <= i ? in.cost.Lzz[i][j].l[lane] : 0.0;
  m.forces = 0;
  for (int c = 0; c < C::n; ++c) {
    if (!contact_active(active, c)) continue;
    Real largest = 0.0;
    for (int r = 0; r < tree.rows[c]; ++r)
      for (int t = 0; t < tree.rows[c]; ++t) {
        m.H[c][r][t] = in.H[c][r][t].l[lane];
        largest += std::fabs(m.H[c][r][t]);
      }
    if (!(largest == 0.0)) m.forces |= 1u << c;
    Real coefficient[6] = {};
    const Real* row[6] = {};
    for (int r = 0; r < tree.rows[c]; ++r) {
      coefficient[r] = in.g[tree.first[c] + r].l[lane];
      row[r] = m.F[tree.first[c] + r];
    }
    if (contact_active(m.forces, c)) dense_rows::combine<nzp>(m.Lz, tree.rows[c], coefficient, row, 1.0);
  }
  if constexpr (nt > 0) contact_finish_rows(in, lane, active, m);
}

}  // namespace engram
#endif  // CONTROLLER_OCP_OCP_CONTACT_MODEL_H_
