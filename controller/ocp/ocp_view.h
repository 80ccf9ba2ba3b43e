// What a cost term sees of a knot, and how it adds its Gauss-Newton model.
#ifndef CONTROLLER_OCP_OCP_VIEW_H_
#define CONTROLLER_OCP_OCP_VIEW_H_

#include "controller/ocp/ocp_knot_model.h"
#include "controller/rbd/rbd_kinematics.h"

namespace engram {

template <class R> inline constexpr bool kFreeBase = has_free_base<R>();
template <class R> using LayoutOf = KnotLayout<R::nv, R::nu>;
template <class R, class S> using ModelOf = KnotModel<LayoutOf<R>, kFreeBase<R>, S>;

// State, control and kinematics of one knot (kLanes knots when S = Pack).
template <class R, class S> struct KnotView {
  const S* q;                         // (nq)
  const S* v;                         // (nv)
  const S* u;                         // (nu)
  const RbdData<R, S>& d;             // kinematics at q
  const S* g;                         // gravity torque g(q) (nv), if a term asks for it
  const Mat<S, R::nv, R::nv>* dg_dq;  // its derivative, if a term asks for it
};

// The dofs that move a joint, from the root outward: count and indices, at compile time.
template <class R> struct DofPath {
  int n = 0;
  int dof[R::nv] = {};

  constexpr explicit DofPath(int joint) {
    const int last = R::iv[joint] + joint_nv<R>(joint) - 1;
    for (int k = last; k >= 0; k = kTree<R>.parent[k]) ++n;
    for (int k = last, i = n; k >= 0; k = kTree<R>.parent[k]) dof[--i] = k;
  }
};

// All dofs, in the form of a path.
template <class R> struct AllDofs {
  static constexpr int n = R::nv;
  int dof[R::nv] = {};

  constexpr AllDofs() {
    for (int k = 0; k < n; ++k) dof[k] = k;
  }
};

// Adds J' diag(w) r to the gradient and J' diag(w) J to the lower Hessian of the coordinates dofs, J (m x n).
template <int m, int columns, class S, class Model>
inline void add_gauss_newton(const S (&J)[m][columns], const int* dofs, int n, const S (&r)[m], const S (&w)[m], Model& M) {
  S wJ[m][columns];
  for (int i = 0; i < m; ++i)
    for (int a = 0; a < n; ++a) wJ[i][a] = w[i] * J[i][a];
  for (int a = 0; a < n; ++a) {
    S gradient = wJ[0][a] * r[0];
    for (int i = 1; i < m; ++i) gradient += wJ[i][a] * r[i];
    M.Lz[dofs[a]] += gradient;
    for (int b = 0; b <= a; ++b) {
      S hessian = wJ[0][a] * J[0][b];
      for (int i = 1; i < m; ++i) hessian += wJ[i][a] * J[i][b];
      M.Lzz[dofs[a]][dofs[b]] += hessian;
    }
  }
}

}  // namespace engram
#endif  // CONTROLLER_OCP_OCP_VIEW_H_
