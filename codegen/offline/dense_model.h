// The linear-quadratic model of a knot as dense matrices, for comparison with others: the solver itself never forms them.
#ifndef CODEGEN_OFFLINE_DENSE_MODEL_H_
#define CODEGEN_OFFLINE_DENSE_MODEL_H_

#include "controller/ocp/ocp_contact_model.h"
#include "controller/ocp/ocp_knot_model.h"

#include <algorithm>

namespace engram::offline {

// Fx (ndx x ndx) and Fu (ndx x nu), row-major, of a knot of length dt (0 at an impact):
//   dv' = D dz,   dq' = E dq + dt G dv'
template <class P> void dense_dynamics(const typename P::LqModel& m, double dt, double* Fx, double* Fu) {
  using L = typename P::Layout;
  constexpr int nv = P::nv, ndx = P::ndx, nu = P::nu;
  const auto base = [](const auto& block, int i, int j) -> double { return i < 6 && j < 6 ? block(i, j) : i == j; };
  for (int j = 0; j < ndx + nu; ++j) {
    const int z = padded_index<L>(j);
    for (int i = 0; i < nv; ++i) {
      double moved = m.D[i][z], kept = i == j;
      if constexpr (P::kFreeBase) {
        if (i < 6) {
          moved = 0.0;
          for (int l = 0; l < 6; ++l) moved += m.G(i, l) * m.D[l][z];
        }
        if (j < nv) kept = base(m.E, i, j);
      }
      (j < ndx ? Fx[i * ndx + j] : Fu[i * nu + j - ndx]) = kept + dt * moved;
      (j < ndx ? Fx[(nv + i) * ndx + j] : Fu[(nv + i) * nu + j - ndx]) = m.D[i][z];
    }
  }
}

// Entry (i, j) of the Hessian in z = (dq, dv, du), without padding.
template <class Layout, bool free_base> double dense_hessian(const KnotModel<Layout, free_base, Real>& m, int i, int j) {
  const int a = padded_index<Layout>(i), b = padded_index<Layout>(j);
  return m.Lzz[std::max(a, b)][std::min(a, b)];
}
template <class C, int nt> double dense_hessian(const ContactKnotModel<C, nt>& m, int i, int j) {
  const int a = padded_index<LayoutOf<typename C::Robot>>(i), b = padded_index<LayoutOf<typename C::Robot>>(j);
  return m.hessian(std::max(a, b), std::min(a, b));
}

}  // namespace engram::offline
#endif  // CODEGEN_OFFLINE_DENSE_MODEL_H_
