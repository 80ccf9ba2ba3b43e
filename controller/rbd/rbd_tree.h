// The kinematic tree of a robot struct R, seen from its degrees of freedom (compile-time).
//
// A free joint counts as six dofs in a chain: dof k hangs on parent[k], so that one loop serves every joint kind.
#ifndef CONTROLLER_RBD_RBD_TREE_H_
#define CONTROLLER_RBD_RBD_TREE_H_

#include "controller/rbd/rbd_types.h"

namespace engram {

constexpr int joint_nv(JointKind kind) { return kind == kFree ? 6 : 1; }

template <class R> struct Tree {
  int joint[R::nv] = {};   // joint of a dof
  int parent[R::nv] = {};  // next dof towards the root, -1 at the root
  int end[R::nv] = {};     // dofs of the subtree of k: [k, end[k])

  constexpr Tree() {
    for (int i = 0; i < R::nj; ++i) {
      const int p = R::parent[i], last = i + R::nsub[i] - 1;
      for (int k = R::iv[i]; k < R::iv[i] + joint_nv(R::kind[i]); ++k) {
        joint[k] = i;
        parent[k] = k > R::iv[i] ? k - 1 : p < 0 ? -1 : R::iv[p] + joint_nv(R::kind[p]) - 1;
        end[k] = R::iv[last] + joint_nv(R::kind[last]);
      }
    }
  }
};

template <class R> inline constexpr Tree<R> kTree{};

// True if the base is free; no other joint may be.
template <class R> constexpr bool has_free_base() { return R::kind[0] == kFree; }

template <class R> constexpr bool only_base_is_free() {
  for (int i = 1; i < R::nj; ++i) {
    if (R::kind[i] == kFree) return false;
  }
  return true;
}

}  // namespace engram
#endif  // CONTROLLER_RBD_RBD_TREE_H_
