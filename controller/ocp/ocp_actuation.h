// How controls become joint forces, tau = B u, and their bounds, u_lo <= u <= u_hi.
//
// By default u drives the last nu dofs and u_lo = -u_max. A robot that is driven otherwise (thrusters) says so with constants
//   static constexpr double actuation[nv][nu], u_lo[nu];
#ifndef CONTROLLER_OCP_OCP_ACTUATION_H_
#define CONTROLLER_OCP_OCP_ACTUATION_H_

#include <type_traits>

namespace engram {

template <class R, class = void> struct Actuation {
  static constexpr int nv = R::nv, nu = R::nu, first = nv - nu;
  static constexpr bool kDrivesDofs = true;               // each control drives one dof
  static constexpr int dof(int i) { return first + i; }   // of control i

  // tau (nv) = B u
  template <class S> static void apply(const S* u, S* tau) {
    for (int i = 0; i < nv; ++i) tau[i] = i < first ? S(0.0) : u[i - first];
  }
  // column i of B, nv entries
  static constexpr double entry(int k, int i) { return k == first + i ? 1.0 : 0.0; }
};

template <class R> struct Actuation<R, std::void_t<decltype(R::actuation)>> {
  static constexpr int nv = R::nv, nu = R::nu;
  static constexpr bool kDrivesDofs = false;
  static constexpr int dof(int) { return -1; }

  template <class S> static void apply(const S* u, S* tau) {
    for (int k = 0; k < nv; ++k) {
      tau[k] = 0.0;
      for (int i = 0; i < nu; ++i) tau[k] += S(R::actuation[k][i]) * u[i];
    }
  }
  static constexpr double entry(int k, int i) { return R::actuation[k][i]; }
};

template <class R, class = void> struct ControlBounds {
  static constexpr double lo(int i) { return -R::u_max[i]; }
  static constexpr double hi(int i) { return R::u_max[i]; }
};
template <class R> struct ControlBounds<R, std::void_t<decltype(R::u_lo)>> {
  static constexpr double lo(int i) { return R::u_lo[i]; }
  static constexpr double hi(int i) { return R::u_max[i]; }
};

}  // namespace engram
#endif  // CONTROLLER_OCP_OCP_ACTUATION_H_
