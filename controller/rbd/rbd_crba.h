// Joint-space inertia matrix by the composite rigid body algorithm.
// Source: Featherstone, Rigid Body Dynamics Algorithms (2008), section 6.2, in world coordinates.
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

// Lower triangle of M: M_kj = J_j . Yc_k J_k (+ armature on the diagonal). After rbd_composite_inertias.
template <class R, class S> inline void rbd_crba_lower(const RbdData<R, S>& d, BranchMatrix<R, S>& M) {
  constexpr const Tree<R>& tree = kTree<R>;
  for (int k = 0; k < R::nv; ++k) {
    const Force<S> F = d.Yc[tree.joint[k]] * d.J[k];
    M.diagonal[k] = dot(d.J[k], F) + R::armature[k];
    for (int e = tree.first[k]; e < tree.first[k] + tree.depth[k]; ++e) M.below[e] = dot(d.J[tree.ancestor[e]], F);
  }
}

// M (nv x nv), symmetric, armature included. After rbd_kinematics; overwrites d.Y, d.Yc.
template <class R, class S> inline void rbd_crba(RbdData<R, S>& d, Mat<S, R::nv, R::nv>& M) {
  constexpr const Tree<R>& tree = kTree<R>;
  BranchMatrix<R, S> lower;
  rbd_inertias(d);
  rbd_composite_inertias(d);
  rbd_crba_lower(d, lower);
  M.setZero();
  for (int k = 0; k < R::nv; ++k) {
    M(k, k) = lower.diagonal[k];
    for (int e = tree.first[k]; e < tree.first[k] + tree.depth[k]; ++e) {
      const int j = tree.ancestor[e];
      M(k, j) = M(j, k) = lower.below[e];
    }
  }
}

}  // namespace engram
#endif  // CONTROLLER_RBD_RBD_CRBA_H_
