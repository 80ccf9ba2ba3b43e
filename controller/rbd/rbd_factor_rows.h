// M = L' D L of one state, on matrices held by rows: every row is worked on over its whole width, as many columns side by side as a
// Pack holds. rbd_factor.h does the same a segment of columns at a time, for states in lanes; entry by entry the operations are equal.
#ifndef CONTROLLER_RBD_RBD_FACTOR_ROWS_H_
#define CONTROLLER_RBD_RBD_FACTOR_ROWS_H_

#include "controller/rbd/rbd_factor.h"

namespace engram {

// nv x nv, rows padded to whole Packs.
template <class R> struct RowMatrix {
  static constexpr int packs = (R::nv + kLanes - 1) / kLanes, stride = packs * kLanes;
  alignas(64) Real x[R::nv * stride];

  Real& operator()(int i, int j) { return x[i * stride + j]; }
  const Real& operator()(int i, int j) const { return x[i * stride + j]; }
  void set_zero() {
    for (int i = 0; i < R::nv * stride; i += kLanes) store_pack(Pack(0.0), x + i);
  }
};

// Packs of the columns that are related to a segment: those of its ancestors, then those of its subtree.
template <class R> struct RelatedPacks {
  int n[R::nv] = {};              // of segment s
  int subtree[R::nv] = {};        // from here on, those of the subtree
  int pack[R::nv][RowMatrix<R>::packs] = {};

  constexpr RelatedPacks() {
    const Tree<R> tree;
    const Segments<R> at;
    for (int s = 0; s < at.n; ++s) {
      const int c = at.begin[s];
      for (int p = 0; p < RowMatrix<R>::packs; ++p) {
        bool related = false;
        for (int j = p * kLanes; j < (p + 1) * kLanes && j < c; ++j) related = related || (j < c && c < tree.end[j]);
        if (related && p < c / kLanes) pack[s][n[s]++] = p;
      }
      subtree[s] = n[s];
      for (int p = c / kLanes; p * kLanes < tree.end[c]; ++p) pack[s][n[s]++] = p;
    }
  }
};

template <class R> inline constexpr RelatedPacks<R> kRelatedPacks{};

// X(j, .) -= sum over k = to - 1, ..., to - w of L(k, j) X(k, .), in the given packs of columns
template <class R, int w>
ENGRAM_INLINE void rbd_subtract_rows(const BranchMatrix<R, Real>& L, int to, int j, const int* pack, const int* end, RowMatrix<R>& X) {
  Pack l[w];
  for (int i = 0; i < w; ++i) l[i] = Pack(L(to - 1 - i, j));
  const Real* const below = &X(to - 1, 0);
  for (Real* const row = &X(j, 0); pack != end; ++pack) {
    const int c = *pack * kLanes;
    Pack sum = load_pack(row + c);
    for (int i = 0; i < w; ++i) sum = nmadd(l[i], load_pack(below - i * RowMatrix<R>::stride + c), sum);
    store_pack(sum, row + c);
  }
}

// Segment s of the pass below: its rows are done from the last to the first, then taken off the rows of its ancestors.
template <class R, int s, bool upper, int... i>
inline void rbd_segment_upwards(const BranchMatrix<R, Real>& L, RowMatrix<R>& X, std::integer_sequence<int, i...>) {
  constexpr const Tree<R>& tree = kTree<R>;
  constexpr int c = kSegments<R>.begin[s], w = kSegments<R>.width(s);
  const int* const pack = kRelatedPacks<R>.pack[s] + (upper ? kRelatedPacks<R>.subtree[s] : 0);
  const int* const end = kRelatedPacks<R>.pack[s] + kRelatedPacks<R>.n[s];
  (rbd_subtract_rows<R, i + 1>(L, c + w, c + w - 2 - i, pack, end, X), ...);
  for (int a = tree.depth[c] - 1; a >= 0; --a) rbd_subtract_rows<R, w>(L, c + w, tree.ancestor[tree.first[c] + a], pack, end, X);
}

// X := L'^-1 X. Entries of dofs on different branches are zero and stay so; with `upper`, those below the diagonal, too.
template <class R, bool upper, int... s>
inline void rbd_rows_upwards(const BranchMatrix<R, Real>& L, RowMatrix<R>& X, std::integer_sequence<int, s...>) {
  constexpr int last = sizeof...(s) - 1;
  (rbd_segment_upwards<R, last - s, upper>(L, X, std::make_integer_sequence<int, kSegments<R>.width(last - s) - 1>()), ...);
}

// X := L^-1 D^-1 X in the Packs [p, p + n) of the rows [begin, end)
template <class R, int p, int n>
inline void rbd_rows_downwards(const BranchMatrix<R, Real>& L, const Real* D_inv, int begin, int end, RowMatrix<R>& X) {
  constexpr const Tree<R>& tree = kTree<R>;
  for (int k = begin; k < end; ++k) {
    Pack row[n];
    const Pack d(D_inv[k]);
    Real* const at = &X(k, p * kLanes);
    for (int i = 0; i < n; ++i) row[i] = load_pack(at + i * kLanes) * d;
    for (int e = tree.first[k]; e < tree.first[k] + tree.depth[k]; ++e) {
      const Pack l(L.below[e]);
      const Real* const above = &X(tree.ancestor[e], p * kLanes);
      for (int i = 0; i < n; ++i) row[i] = nmadd(l, load_pack(above + i * kLanes), row[i]);
    }
    for (int i = 0; i < n; ++i) store_pack(row[i], at + i * kLanes);
  }
}

// X := M^-1 X, all columns. On entry X(k, c) is zero unless k and c lie on one branch.
template <class R> inline void rbd_factor_solve(const BranchMatrix<R, Real>& L, const Real* D_inv, RowMatrix<R>& X) {
  constexpr int packs = RowMatrix<R>::packs, most = 12, n = packs < most ? packs : most;  // what the registers hold
  rbd_rows_upwards<R, false>(L, X, std::make_integer_sequence<int, kSegments<R>.n>());
  rbd_rows_downwards<R, 0, n>(L, D_inv, 0, R::nv, X);
  if constexpr (packs > n) rbd_rows_downwards<R, n, packs - n>(L, D_inv, 0, R::nv, X);
}

template <class R, int... p> inline void rbd_upper_rows_downwards(const BranchMatrix<R, Real>& L, const Real* D_inv,
                                                                  RowMatrix<R>& X, std::integer_sequence<int, p...>) {
  constexpr auto end = [](int rows) { return rows < R::nv ? rows : R::nv; };
  (rbd_rows_downwards<R, p, RowMatrix<R>::packs - p>(L, D_inv, p * kLanes, end((p + 1) * kLanes), X), ...);
}

// X := M^-1: the upper triangle row by row, the lower one by symmetry.
template <class R> inline void rbd_factor_inverse(const BranchMatrix<R, Real>& L, const Real* D_inv, RowMatrix<R>& X) {
  X.set_zero();
  for (int k = 0; k < R::nv; ++k) X(k, k) = 1.0;
  rbd_rows_upwards<R, true>(L, X, std::make_integer_sequence<int, kSegments<R>.n>());
  rbd_upper_rows_downwards<R>(L, D_inv, X, std::make_integer_sequence<int, RowMatrix<R>::packs>());
  for (int k = 0; k < R::nv; ++k) {
    for (int j = 0; j < k; ++j) X(k, j) = X(j, k);
  }
}

}  // namespace engram
#endif  // CONTROLLER_RBD_RBD_FACTOR_ROWS_H_
