// The kinematic tree of a robot struct R, seen from its degrees of freedom (compile-time).
//
// A free joint counts as six dofs in a chain: dof k hangs on parent[k], so that one loop serves every joint kind.
#ifndef CONTROLLER_RBD_RBD_TREE_H_
#define CONTROLLER_RBD_RBD_TREE_H_

#include "controller/rbd/rbd_types.h"

namespace engram {

// True if the base is free; no other joint may be.
template <class R> constexpr bool has_free_base() { return R::kind[0] == kFree; }

template <class R> constexpr bool only_base_is_free() {
  for (int i = 1; i < R::nj; ++i) {
    if (R::kind[i] == kFree) return false;
  }
  return true;
}

// Dofs of joint i.
template <class R> constexpr int joint_nv(int i) { return has_free_base<R>() && i == 0 ? 6 : 1; }

// Pairs (dof, ancestor of it): what M has below its diagonal. At least 1, to size arrays.
template <class R> constexpr int branch_pairs() {
  int depth[R::nv] = {}, pairs = 0;
  for (int i = 0; i < R::nj; ++i) {
    const int p = R::parent[i], n = joint_nv<R>(i);
    for (int k = R::iv[i]; k < R::iv[i] + n; ++k) {
      depth[k] = k > R::iv[i] ? depth[k - 1] + 1 : p < 0 ? 0 : depth[R::iv[p] + joint_nv<R>(p) - 1] + 1;
      pairs += depth[k];
    }
  }
  return pairs > 0 ? pairs : 1;
}

template <class R> struct Tree {
  static_assert(only_base_is_free<R>(), "only the first joint may be free");
  int last[R::nj] = {};                  // last dof of a joint
  int joint[R::nv] = {};                 // joint of a dof
  int parent[R::nv] = {};                // next dof towards the root, -1 at the root
  int end[R::nv] = {};                   // dofs of the subtree of k: [k, end[k])
  int depth[R::nv] = {};                 // number of ancestors
  int first[R::nv] = {};                 // where k's ancestors begin in
  int ancestor[branch_pairs<R>()] = {};  // the ancestors of dof 0, of dof 1, ..., root first

  constexpr Tree() {
    for (int i = 0; i < R::nj; ++i) last[i] = R::iv[i] + joint_nv<R>(i) - 1;
    int next = 0;
    for (int k = 0, i = 0; k < R::nv; ++k) {
      if (k > last[i]) ++i;
      const int p = R::parent[i];
      parent[k] = k > R::iv[i] ? k - 1 : p < 0 ? -1 : last[p];
      joint[k] = i;
      end[k] = last[i + R::nsub[i] - 1] + 1;
      first[k] = next;
      if (parent[k] >= 0) {
        for (int a = 0; a < depth[parent[k]]; ++a) ancestor[next++] = ancestor[first[parent[k]] + a];
        ancestor[next++] = parent[k];
        depth[k] = depth[parent[k]] + 1;
      }
    }
  }
};

template <class R> inline constexpr Tree<R> kTree{};

// A lower triangular matrix over the dofs whose entries (k, j) vanish unless j is k or an ancestor of k.
template <class R, class S> struct BranchMatrix {
  S diagonal[R::nv];
  S below[branch_pairs<R>() + kLanes];  // entry (k, j) at first[k] + depth[j]: a row is contiguous, root first; room to run over

  const S& operator()(int k, int j) const { return below[kTree<R>.first[k] + kTree<R>.depth[j]]; }  // j an ancestor of k
};

}  // namespace engram
#endif  // CONTROLLER_RBD_RBD_TREE_H_
