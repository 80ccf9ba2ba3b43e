// Joint-space inertia matrix by the composite rigid body algorithm, and its branch-sparse factor.
// Source: Featherstone, Rigid Body Dynamics Algorithms (2008), sections 6.2 (CRBA) and 6.5 (L'DL).
#ifndef CONTROLLER_RBD_RBD_CRBA_H_
#define CONTROLLER_RBD_RBD_CRBA_H_

#include "controller/rbd/rbd_kinematics.h"

namespace engram {

// d.Yc: inertia of every subtree. After rbd_inertias.
template <class R, class S> inline void rbd_composite_inertias(RbdData<R, S>& d) {
  for (int i = 0; i < R::nj; ++i) d.Yc[i] = d.Y[i];
  for (int i = R::nj - 1; i >= 0; --i) {
    if (const int p = R::parent[i]; p >= 0) d.Yc[p] += d.Yc[i];
  }
}

// Lower triangle of M, entries (k, ancestor of k) only: M_kj = J_j . Yc_k J_k (+ armature on the diagonal).
// After rbd_composite_inertias.
template <class R, class S> inline void rbd_crba_lower(const RbdData<R, S>& d, Mat<S, R::nv, R::nv>& M) {
  for (int k = 0; k < R::nv; ++k) {
    const Force<S> F = d.Yc[kTree<R>.joint[k]] * d.J[k];
    M(k, k) = dot(d.J[k], F) + R::armature[k];
    for (int j = kTree<R>.parent[k]; j >= 0; j = kTree<R>.parent[j]) M(k, j) = dot(d.J[j], F);
  }
}

// M (nv x nv), symmetric, armature included. After rbd_kinematics; overwrites d.Y, d.Yc.
template <class R, class S> inline void rbd_crba(RbdData<R, S>& d, Mat<S, R::nv, R::nv>& M) {
  rbd_inertias(d);
  rbd_composite_inertias(d);
  M.setZero();
  rbd_crba_lower(d, M);
  for (int k = 0; k < R::nv; ++k) {
    for (int j = 0; j < k; ++j) M(j, k) = M(k, j);
  }
}

// In place M = L' D L from the entries (k, ancestor of k): strictly lower part of M becomes L, D_inv = 1 / D.
// M is positive definite for any q if every body or armature is; nothing is checked.
template <class R, class S> inline void rbd_factor(Mat<S, R::nv, R::nv>& M, S* D_inv) {
  constexpr const Tree<R>& tree = kTree<R>;
  for (int k = R::nv - 1; k >= 0; --k) {
    D_inv[k] = 1.0 / M(k, k);
    for (int i = tree.parent[k]; i >= 0; i = tree.parent[i]) {
      const S l = M(k, i) * D_inv[k];
      for (int j = i; j >= 0; j = tree.parent[j]) M(i, j) = nmadd(l, M(k, j), M(i, j));
      M(k, i) = l;
    }
  }
}

// x := M^-1 x with the factor of rbd_factor.
template <class R, class S> inline void rbd_factor_solve(const Mat<S, R::nv, R::nv>& L, const S* D_inv, S* x) {
  constexpr const Tree<R>& tree = kTree<R>;
  for (int k = R::nv - 1; k >= 0; --k) {
    for (int j = tree.parent[k]; j >= 0; j = tree.parent[j]) x[j] = nmadd(L(k, j), x[k], x[j]);
  }
  for (int k = 0; k < R::nv; ++k) {
    x[k] *= D_inv[k];
    for (int j = tree.parent[k]; j >= 0; j = tree.parent[j]) x[k] = nmadd(L(k, j), x[j], x[k]);
  }
}

}  // namespace engram
#endif  // CONTROLLER_RBD_RBD_CRBA_H_
