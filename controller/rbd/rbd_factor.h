// M = L' D L of a joint-space inertia matrix, L unit lower triangular and as sparse as the tree: L(k, j) only for j an ancestor of k.
// Solves for a vector and for the derivatives of inverse dynamics, and the inverse.
// Source: Featherstone, Rigid Body Dynamics Algorithms (2008), section 6.5.
#ifndef CONTROLLER_RBD_RBD_FACTOR_H_
#define CONTROLLER_RBD_RBD_FACTOR_H_

#include "controller/rbd/rbd_tree.h"

#include <utility>

namespace engram {

// In place: M becomes L, with D on the diagonal; D_inv = 1 / D.
// M is positive definite for any q if every body or armature is; nothing is checked.
template <class R, class S> inline void rbd_factor(BranchMatrix<R, S>& M, S* D_inv) {
  constexpr const Tree<R>& tree = kTree<R>;
  for (int k = R::nv - 1; k >= 0; --k) {
    D_inv[k] = 1.0 / M.diagonal[k];
    S* row = M.below + tree.first[k];
    for (int a = tree.depth[k] - 1; a >= 0; --a) {
      const int i = tree.ancestor[tree.first[k] + a];
      const S l = row[a] * D_inv[k];
      // row i -= l (row k up to i)
      M.diagonal[i] = nmadd(l, row[a], M.diagonal[i]);
      S* row_i = M.below + tree.first[i];
      for (int t = 0; t < a; ++t) row_i[t] = nmadd(l, row[t], row_i[t]);
      row[a] = l;
    }
  }
}

// x := M^-1 x
template <class R, class S> inline void rbd_factor_solve(const BranchMatrix<R, S>& L, const S* D_inv, S* x) {
  constexpr const Tree<R>& tree = kTree<R>;
  for (int k = R::nv - 1; k >= 0; --k) {
    for (int e = tree.first[k]; e < tree.first[k] + tree.depth[k]; ++e) {
      const int j = tree.ancestor[e];
      x[j] = nmadd(L.below[e], x[k], x[j]);
    }
  }
  for (int k = 0; k < R::nv; ++k) {
    S sum = x[k] * D_inv[k];
    for (int e = tree.first[k]; e < tree.first[k] + tree.depth[k]; ++e) sum = nmadd(L.below[e], x[tree.ancestor[e]], sum);
    x[k] = sum;
  }
}

// Columns are solved a segment at a time: dofs in a chain without branches, at most eight to stay in registers. They share their
// ancestors and what hangs below the chain, and so their pattern of zeros.
template <class R> struct Segments {
  int n = 0;
  int begin[R::nv + 1] = {};

  constexpr Segments() {
    const Tree<R> tree;
    for (int k = 0; k < R::nv; ++k) {
      const bool goes_on =
          k > 0 && tree.depth[k] == tree.depth[k - 1] + 1 && tree.end[k] == tree.end[k - 1] && k - begin[n - 1] < 8;
      if (!goes_on) begin[n++] = k;
    }
    begin[n] = R::nv;
  }
  constexpr int width(int s) const { return begin[s + 1] - begin[s]; }
};

template <class R> inline constexpr Segments<R> kSegments{};

// w neighbours in a row, held in registers.
template <class S, int w> struct RowPart {
  S x[w];

  ENGRAM_INLINE explicit RowPart(Real all) {
    for (int i = 0; i < w; ++i) x[i] = S(all);
  }
  ENGRAM_INLINE explicit RowPart(const S* from) {
    for (int i = 0; i < w; ++i) x[i] = from[i];
  }
  ENGRAM_INLINE void store(S* to) const {
    for (int i = 0; i < w; ++i) to[i] = x[i];
  }
  ENGRAM_INLINE void subtract(S l, const S* row) {
    for (int i = 0; i < w; ++i) x[i] = nmadd(l, row[i], x[i]);
  }
  ENGRAM_INLINE void scale(S d) {
    for (int i = 0; i < w; ++i) x[i] *= d;
  }
};

// Of doubles, as many as possible side by side in a Pack.
template <int w> struct RowPart<Real, w> {
  static constexpr int in_packs = w - w % kLanes;
  Pack p[w / kLanes + 1];
  Real x[kLanes];

  ENGRAM_INLINE explicit RowPart(Real all) {
    for (int i = 0; i < in_packs; i += kLanes) p[i / kLanes] = Pack(all);
    for (int i = in_packs; i < w; ++i) x[i - in_packs] = all;
  }
  ENGRAM_INLINE explicit RowPart(const Real* from) {
    for (int i = 0; i < in_packs; i += kLanes) p[i / kLanes] = load_pack(from + i);
    for (int i = in_packs; i < w; ++i) x[i - in_packs] = from[i];
  }
  ENGRAM_INLINE void store(Real* to) const {
    for (int i = 0; i < in_packs; i += kLanes) store_pack(p[i / kLanes], to + i);
    for (int i = in_packs; i < w; ++i) to[i] = x[i - in_packs];
  }
  ENGRAM_INLINE void subtract(Real l, const Real* row) {
    for (int i = 0; i < in_packs; i += kLanes) p[i / kLanes] = nmadd(Pack(l), load_pack(row + i), p[i / kLanes]);
    for (int i = in_packs; i < w; ++i) x[i - in_packs] = nmadd(l, row[i], x[i - in_packs]);
  }
  ENGRAM_INLINE void scale(Real d) {
    for (int i = 0; i < in_packs; i += kLanes) p[i / kLanes] *= Pack(d);
    for (int i = in_packs; i < w; ++i) x[i - in_packs] *= d;
  }
};

// The two passes below work on columns [c, c + w) of X, a segment's, by rows.

// X := L'^-1 X in the rows [c, end), c's subtree or a part of it that holds all of X below c, and in the rows of c's ancestors.
template <class R, int c, int w, class S>
inline void rbd_solve_upwards(const BranchMatrix<R, S>& L, int end, Mat<S, R::nv, R::nv>& X) {
  constexpr const Tree<R>& tree = kTree<R>;
  for (int j = end - 1; j >= c; --j) {
    RowPart<S, w> row(&X(j, c));
    for (int k = (end < tree.end[j] ? end : tree.end[j]) - 1; k > j; --k)
      row.subtract(L.below[tree.first[k] + tree.depth[j]], &X(k, c));
    row.store(&X(j, c));
  }
  for (int a = tree.depth[c] - 1; a >= 0; --a) {
    const int j = tree.ancestor[tree.first[c] + a];
    RowPart<S, w> row(&X(j, c));
    for (int k = end - 1; k >= c; --k) row.subtract(L.below[tree.first[k] + a], &X(k, c));
    for (int b = tree.depth[c] - 1; b > a; --b) {
      const int k = tree.ancestor[tree.first[c] + b];
      row.subtract(L.below[tree.first[k] + a], &X(k, c));
    }
    row.store(&X(j, c));
  }
}

// X := L^-1 D^-1 X in the rows [0, end), where rows that are not on c's branch hold zero without being stored.
template <class R, int c, int w, class S>
inline void rbd_solve_downwards(const BranchMatrix<R, S>& L, const S* D_inv, int end, Mat<S, R::nv, R::nv>& X) {
  constexpr const Tree<R>& tree = kTree<R>;
  for (int k = 0; k < end; ++k) {
    const bool on_branch = k < tree.end[c] && c < tree.end[k];
    RowPart<S, w> row = on_branch ? RowPart<S, w>(&X(k, c)) : RowPart<S, w>(0.0);
    row.scale(D_inv[k]);
    for (int e = tree.first[k]; e < tree.first[k] + tree.depth[k]; ++e) row.subtract(L.below[e], &X(tree.ancestor[e], c));
    row.store(&X(k, c));
  }
}

template <class R, class S, int... s> inline void rbd_solve_segments(const BranchMatrix<R, S>& L, const S* D_inv,
                                                                     Mat<S, R::nv, R::nv>& X, std::integer_sequence<int, s...>) {
  constexpr const Segments<R>& at = kSegments<R>;
  ((rbd_solve_upwards<R, at.begin[s], at.width(s)>(L, kTree<R>.end[at.begin[s]], X),
    rbd_solve_downwards<R, at.begin[s], at.width(s)>(L, D_inv, R::nv, X)),
   ...);
}

// X := M^-1 X, all columns. On entry X(k, c) is zero, and need not be stored, unless k and c lie on one branch.
template <class R, class S> inline void rbd_factor_solve(const BranchMatrix<R, S>& L, const S* D_inv, Mat<S, R::nv, R::nv>& X) {
  rbd_solve_segments<R>(L, D_inv, X, std::make_integer_sequence<int, kSegments<R>.n>());
}

template <class R, class S, int... s> inline void rbd_invert_segments(const BranchMatrix<R, S>& L, const S* D_inv,
                                                                      Mat<S, R::nv, R::nv>& X, std::integer_sequence<int, s...>) {
  constexpr const Segments<R>& at = kSegments<R>;
  ((rbd_solve_upwards<R, at.begin[s], at.width(s)>(L, at.begin[s + 1], X),
    rbd_solve_downwards<R, at.begin[s], at.width(s)>(L, D_inv, at.begin[s + 1], X)),
   ...);
}

// X := M^-1: the upper triangle column by column, the lower one by symmetry.
template <class R, class S> inline void rbd_factor_inverse(const BranchMatrix<R, S>& L, const S* D_inv, Mat<S, R::nv, R::nv>& X) {
  X.setIdentity();
  rbd_invert_segments<R>(L, D_inv, X, std::make_integer_sequence<int, kSegments<R>.n>());
  for (int k = 0; k < R::nv; ++k) {
    for (int j = 0; j < k; ++j) X(k, j) = X(j, k);
  }
}

}  // namespace engram
#endif  // CONTROLLER_RBD_RBD_FACTOR_H_
