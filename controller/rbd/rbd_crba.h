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
    M.diagonal[k] = dot(d.J[k], F) + S(R::armature[k]);
    for (int e = tree.first[k]; e < tree.first[k] + tree.depth[k]; ++e) M.below[e] = dot(d.J[tree.ancestor[e]], F);
  }
}

// The same for one state, as many ancestors at once as a Pack holds. In depth-first order the ancestors of dof k are what a stack holds
// up to its depth: path[row][depth] is entry `row` of their columns of J.
template <class R> inline void rbd_crba_lower(const RbdData<R, Real>& d, BranchMatrix<R, Real>& M) {
  constexpr const Tree<R>& tree = kTree<R>;
  Real path[6][R::nv + kLanes] = {};  // beyond the depth: whatever, but numbers
  for (int k = 0; k < R::nv; ++k) {
    const Motion<Real>& J = d.J[k];
    const Force<Real> F = d.Yc[tree.joint[k]] * J;
    Real* const row = M.below + tree.first[k];
    M.diagonal[k] = dot(J, F) + Real(R::armature[k]);
    for (int a = 0; a < tree.depth[k]; a += kLanes) {  // what runs over the end of a row, the next one overwrites
      const auto part = [&](int r) { return load_pack(path[r] + a); };
      const Motion<Pack> columns = {{part(0), part(1), part(2)}, {part(3), part(4), part(5)}};
      const Force<Pack> force = {{F.lin[0], F.lin[1], F.lin[2]}, {F.ang[0], F.ang[1], F.ang[2]}};
      store_pack(dot(columns, force), row + a);
    }
    for (int r = 0; r < 3; ++r) {
      path[r][tree.depth[k]] = J.lin[r];
      path[3 + r][tree.depth[k]] = J.ang[r];
    }
  }
}

// The same from the placements alone. After rbd_kinematics; overwrites d.Yc.
template <class R, class S> inline void rbd_crba_branches(RbdData<R, S>& d, BranchMatrix<R, S>& M) {
  rbd_body_inertias(d, d.Yc);
  for (int i = R::nj - 1; i >= 0; --i) {
    if (const int p = R::parent[i]; p >= 0) d.Yc[p] += d.Yc[i];
  }
  rbd_crba_lower(d, M);
}

// The entries of the upper triangle of M (nv x nv) that the tree's branches leave; the others are not written. After rbd_kinematics;
// overwrites d.Yc. What Pinocchio's crba leaves behind.
template <class R, class Matrix, class S> inline void rbd_crba_upper(RbdData<R, S>& d, Matrix& M) {
  constexpr const Tree<R>& tree = kTree<R>;
  BranchMatrix<R, S> lower;
  rbd_crba_branches(d, lower);
  for (int k = 0; k < R::nv; ++k) {
    M(k, k) = lower.diagonal[k];
    for (int e = tree.first[k]; e < tree.first[k] + tree.depth[k]; ++e) M(tree.ancestor[e], k) = lower.below[e];
  }
}

// M (nv x nv), symmetric, armature included. After rbd_kinematics; overwrites d.Yc.
template <class R, class S> inline void rbd_crba(RbdData<R, S>& d, Mat<S, R::nv, R::nv>& M) {
  constexpr const Tree<R>& tree = kTree<R>;
  M.setZero();
  rbd_crba_upper(d, M);
  for (int k = 0; k < R::nv; ++k) {
    for (int e = tree.first[k]; e < tree.first[k] + tree.depth[k]; ++e) M(k, tree.ancestor[e]) = M(tree.ancestor[e], k);
  }
}

}  // namespace engram
#endif  // CONTROLLER_RBD_RBD_CRBA_H_
