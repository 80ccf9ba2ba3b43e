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

template <class R> struct Tree {
  static_assert(only_base_is_free<R>(), "only the first joint may be free");
  int joint[R::nv] = {};   // joint of a dof
  int parent[R::nv] = {};  // next dof towards the root, -1 at the root
  int last[R::nj] = {};    // last dof of a joint

  constexpr Tree() {
    for (int i = 0; i < R::nj; ++i) {
      const int p = R::parent[i];
      last[i] = R::iv[i] + joint_nv<R>(i) - 1;
      for (int k = R::iv[i]; k <= last[i]; ++k) {
        joint[k] = i;
        parent[k] = k > R::iv[i] ? k - 1 : p < 0 ? -1 : last[p];
      }
    }
  }
};

template <class R> inline constexpr Tree<R> kTree{};

}  // namespace engram
#endif  // CONTROLLER_RBD_RBD_TREE_H_
