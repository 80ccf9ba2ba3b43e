// A value with its derivatives by n variables: what a formula is evaluated with to be differentiated to rounding.
#ifndef CONTROLLER_OCP_OCP_DUAL_H_
#define CONTROLLER_OCP_OCP_DUAL_H_

#include "controller/rbd/rbd_math.h"

namespace engram {

template <class S, int n> struct Dual {
  S value;
  S d[n];

  Dual() = default;
  Dual(Real constant) : value(constant) {  // NOLINT: a constant is a dual
    for (S& x : d) x = 0.0;
  }
  // Variable number i.
  Dual(S x, int i) : value(x) {
    for (int j = 0; j < n; ++j) d[j] = i == j ? 1.0 : 0.0;
  }
  // f with slopes fa, fb by a and b.
  Dual(S f, S fa, const Dual& a, S fb, const Dual& b) : value(f) {
    for (int j = 0; j < n; ++j) d[j] = fa * a.d[j] + fb * b.d[j];
  }
  // f with slope fa by a.
  Dual(S f, S fa, const Dual& a) : value(f) {
    for (int j = 0; j < n; ++j) d[j] = fa * a.d[j];
  }

  friend Dual operator+(const Dual& a, const Dual& b) { return {a.value + b.value, S(1.0), a, S(1.0), b}; }
  friend Dual operator-(const Dual& a, const Dual& b) { return {a.value - b.value, S(1.0), a, S(-1.0), b}; }
  friend Dual operator-(const Dual& a) { return {-a.value, S(-1.0), a}; }
  friend Dual operator*(const Dual& a, const Dual& b) { return {a.value * b.value, b.value, a, a.value, b}; }
};

template <class S, int n> void sincos(const Dual<S, n>& a, Dual<S, n>& s, Dual<S, n>& c) {
  S sine, cosine;
  sincos(a.value, sine, cosine);
  s = {sine, cosine, a};
  c = {cosine, -sine, a};
}

}  // namespace engram
#endif  // CONTROLLER_OCP_OCP_DUAL_H_
