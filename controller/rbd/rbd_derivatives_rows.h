// The derivatives of rbd_derivatives.h for one state, into padded rows: as many ancestors, or columns, side by side as a Pack holds. Entry
// by entry the operations are the same.
#ifndef CONTROLLER_RBD_RBD_DERIVATIVES_ROWS_H_
#define CONTROLLER_RBD_RBD_DERIVATIVES_ROWS_H_

#include "controller/rbd/rbd_derivatives.h"
#include "controller/rbd/rbd_factor_rows.h"

namespace engram {

// Columns of the ancestors of a dof, side by side: in depth-first order they are what a stack holds up to its depth.
template <class R, int rows> struct PathStack {
  Real x[rows][R::nv + kLanes] = {};  // beyond the depth: whatever, but numbers

  ENGRAM_INLINE Vec3<Pack> vector(int row, int a) const {
    return {load_pack(x[row] + a), load_pack(x[row + 1] + a), load_pack(x[row + 2] + a)};
  }
  ENGRAM_INLINE Motion<Pack> motion(int row, int a) const { return {vector(row, a), vector(row + 3, a)}; }
  ENGRAM_INLINE void set(int row, int depth, const Vec3<Real>& v) {
    for (int r = 0; r < 3; ++r) x[row + r][depth] = v[r];
  }
  ENGRAM_INLINE void set(int row, int depth, const Motion<Real>& m) {
    set(row, depth, m.lin);
    set(row + 3, depth, m.ang);
  }
};

ENGRAM_INLINE Vec3<Pack> broadcast(const Vec3<Real>& v) { return {v[0], v[1], v[2]}; }
ENGRAM_INLINE Force<Pack> broadcast(const Force<Real>& f) { return {broadcast(f.lin), broadcast(f.ang)}; }

// As its namesake of rbd_derivatives.h.
template <class R>
inline void rbd_rnea_derivatives_on_branches(const RbdData<R, Real>& d, RowMatrix<R>& dtau_dq, RowMatrix<R>& dtau_dv) {
  constexpr const Tree<R>& tree = kTree<R>;
  const BranchDerivatives<R, Real> b(d);
  enum { kJ = 0, kAdq = 6, kAdv = 12, kVdq = 18, kRows = 21 };
  PathStack<R, kRows> path;
  for (int k = 0; k < R::nv; ++k) {
    const BranchRow<Real> row(d, b, k);
    const int depth = tree.depth[k];
    dtau_dv(k, k) = row.diagonal_v;
    dtau_dq(k, k) = row.diagonal_q;
    const Force<Pack> dFdq = broadcast(row.dFdq), dFdv = broadcast(row.dFdv), F = broadcast(row.F);
    const Vec3<Pack> g = broadcast(row.g);
    Real column_q[R::nv + kLanes], column_v[R::nv + kLanes], row_q[R::nv + kLanes], row_v[R::nv + kLanes];
    for (int a = 0; a < depth; a += kLanes) {
      const Motion<Pack> J = path.motion(kJ, a);
      store_pack(dot(J, dFdv), column_v + a);
      store_pack(dot(J, dFdq), column_q + a);
      store_pack(dot_add(g, J.ang, dot(path.motion(kAdv, a), F)), row_v + a);
      store_pack(dot_add(g, path.vector(kVdq, a), dot(path.motion(kAdq, a), F)), row_q + a);
    }
    const int* const ancestor = tree.ancestor + tree.first[k];
    for (int a = 0; a < depth; ++a) {
      const int j = ancestor[a];
      dtau_dv(j, k) = column_v[a];
      dtau_dq(j, k) = column_q[a];
      dtau_dv(k, j) = row_v[a];
      dtau_dq(k, j) = row_q[a];
    }
    path.set(kJ, depth, d.J[k]);
    path.set(kAdq, depth, b.dAdq[k]);
    path.set(kAdv, depth, b.dAdv[k]);
    path.set(kVdq, depth, b.dVdq[k]);
  }
}

// As its namesake of rbd_derivatives.h.
template <class R> inline void rbd_rnea_derivatives(const RbdData<R, Real>& d, RowMatrix<R>& dtau_dq, RowMatrix<R>& dtau_dv) {
  dtau_dq.set_zero();
  dtau_dv.set_zero();
  rbd_rnea_derivatives_on_branches(d, dtau_dq, dtau_dv);
}

// As its namesake of rbd_derivatives.h.
template <class R> inline void rbd_forward_derivatives(RbdData<R, Real>& d, const Real* a, RowMatrix<R>& da_dq,
                                                       RowMatrix<R>& da_dv, RowMatrix<R>& Minv) {
  rbd_accelerate(a, d);
  rbd_rnea_derivatives(d, da_dq, da_dv);
  Real minus_D_inv[R::nv];
  for (int k = 0; k < R::nv; ++k) minus_D_inv[k] = -d.D_inv[k];
  rbd_factor_solve(d.L, minus_D_inv, da_dq);
  rbd_factor_solve(d.L, minus_D_inv, da_dv);
  rbd_factor_inverse(d.L, d.D_inv, Minv);
}

}  // namespace engram
#endif  // CONTROLLER_RBD_RBD_DERIVATIVES_ROWS_H_
