// What costs of contact forces and coupled residuals add to the sweep: their Hessian never becomes part of a knot's stored one.
#ifndef CONTROLLER_FDDP_FDDP_FORCE_COSTS_H_
#define CONTROLLER_FDDP_FDDP_FORCE_COSTS_H_

#include "controller/fddp/fddp.h"
#include "controller/fddp/fddp_kernels.h"
#include "controller/ocp/ocp_contact_model.h"

#include <cstring>

namespace engram {

// Q += F' H F of the force costs.
template <class P, int N> void add_force_hessian(const typename FddpWork<P, N>::Model& m, FddpWork<P, N>& w) {
  using L = typename P::Layout;
  using C = typename P::Contacts;
  constexpr int nzp = L::nzp;
  for_contact<C>([&](auto c) {
    if (!contact_active(m.forces, c)) return;
    constexpr int first = kContactTree<C>.first[c], rows = kContactTree<C>.rows[c];
    std::memset(w.W, 0, rows * sizeof(w.W[0]));
    kernel::product<rows, nzp, rows>(&m.H[c][0][0], 6, m.F[first], nzp, &w.W[0][0], nzp);
    kernel::product_lower<nzp, rows>(m.F[first], nzp, &w.W[0][0], nzp, &w.Q[0][0], nzp);
  });
}

// Q += T' T of coupled residuals: the first n rows and columns.
template <int n, int ld, class Model> void add_coupled_hessian(const Model& m, Real (*Q)[ld]) {
  if constexpr (Model::nt > 0)
    if (m.coupled) kernel::product_lower<n, Model::nt>(m.T[0], Model::L::nzp, m.T[0], Model::L::nzp, Q[0], ld);
}

}  // namespace engram
#endif  // CONTROLLER_FDDP_FDDP_FORCE_COSTS_H_
