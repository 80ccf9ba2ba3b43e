// The linear-quadratic model of one knot, and the layout that the solver sweeps.
//
//   dv' = D dz                       z = (q, v, u) in the tangent space
//   dq' = E dq + dt G dv'            E = G = I except in the 6x6 block of a free base
//   l   ~ l0 + Lz' dz + 1/2 dz' Lzz dz
//
// This is all that a semi-implicit step leaves to know: the dense Fx is never formed. Each block q, v, u starts at a multiple of
// the vector width, so that kernels load aligned and need no remainders; what pads a block stays zero.
#ifndef CONTROLLER_OCP_OCP_KNOT_MODEL_H_
#define CONTROLLER_OCP_OCP_KNOT_MODEL_H_

#include "controller/rbd/rbd_types.h"

#include <cstddef>
#include <cstring>

namespace engram {

#ifdef __AVX512F__
inline constexpr int kVectorBytes = 64;  // a register of the dense kernels
#else
inline constexpr int kVectorBytes = 32;
#endif
inline constexpr int kVector = kVectorBytes / sizeof(Real);
constexpr int padded(int n) { return (n + kVector - 1) / kVector * kVector; }

// The phase of the terminal knot, in problems with phases.
inline constexpr unsigned kTerminalPhase = 1u << 30;
// Bit of a phase that takes no time: an impact.
inline constexpr unsigned kImpactPhase = 1u << 31;

// Sizes and offsets of z = (q, v, u) for nv velocities and nu controls.
template <int nv_, int nu_> struct KnotLayout {
  static constexpr int nv = nv_, nu = nu_, ndx = 2 * nv_;
  static constexpr int oq = 0, ov = padded(nv), ou = 2 * padded(nv);  // first entry of each block
  static constexpr int nxp = 2 * padded(nv);                          // padded size of dx = (dq, dv)
  static constexpr int nup = padded(nu);
  static constexpr int nzp = nxp + nup;                               // padded size of dz
};

// The base block of the integrator; nothing for a fixed base.
template <bool free_base, class S> struct BaseBlock {};
template <class S> struct BaseBlock<true, S> {
  Mat<S, 6, 6> E;  // d q' / d q
  Mat<S, 6, 6> G;  // d q' / d (dt v')
};

// S = double: one knot. S = Pack: kLanes knots side by side, element by element in the same order.
template <class Layout, bool free_base, class S> struct KnotModel : BaseBlock<free_base, S> {
  alignas(64) S D[Layout::nv][Layout::nzp];     // d v' / d z                                  (nv x nz)
  alignas(64) S Lz[Layout::nzp];                // d l / d z                                   (nz)
  alignas(64) S Lzz[Layout::nzp][Layout::nzp];  // Gauss-Newton Hessian, lower triangle        (nz x nz)
};

// n doubles, a multiple of kVector, between vector boundaries. Rows are short: the processor's block copy, which the compiler makes of
// memcpy and of a plain loop, takes longer to start than they take.
inline void copy_row(Real* to, const Real* from, int n) {
  typedef Real Vector __attribute__((vector_size(kVectorBytes), aligned(kVectorBytes), may_alias));
  for (int j = 0; j < n; j += kVector) {
    Vector v = *reinterpret_cast<const Vector*>(from + j);
#ifdef __x86_64__
    asm("" : "+v"(v));
#endif
    *reinterpret_cast<Vector*>(to + j) = v;
  }
}

// Block qq of a knot's Hessian, lower triangle up to the padding, into rows of ld; all blocks of the state likewise.
template <class Layout, bool free_base, int ld> inline void copy_hessian_qq(const KnotModel<Layout, free_base, Real>& m, Real (*to)[ld]) {
  for (int i = 0; i < Layout::nv; ++i) copy_row(to[i], m.Lzz[i], padded(i + 1));
}
template <class Layout, bool free_base, int ld> inline void copy_hessian_x(const KnotModel<Layout, free_base, Real>& m, Real (*to)[ld]) {
  for (int i = 0; i < Layout::nxp; ++i) copy_row(to[i], m.Lzz[i], padded(i + 1));
}
// True for a model whose stored Hessian is block qq and a diagonal.
template <class Model> inline constexpr bool kDiagonalHessian = false;

// Where coordinate i of dz = (dq, dv, du) stands in a padded vector.
template <class Layout> constexpr int padded_index(int i) {
  return i < Layout::nv ? i : i < Layout::ndx ? Layout::ov + i - Layout::nv : Layout::ou + i - Layout::ndx;
}

}  // namespace engram
#endif  // CONTROLLER_OCP_OCP_KNOT_MODEL_H_
