// A scalar that counts: the algorithms are templates over their scalar, so the flops they take can be counted instead of claimed.
// A fused multiply-add counts as two.
#ifndef BENCH_COUNTING_H_
#define BENCH_COUNTING_H_

#include "controller/rbd/rbd_pack.h"

namespace engram {

struct Counting {
  double value;
  static inline long flops = 0;

  Counting() = default;
  Counting(double v) : value(v) {}  // NOLINT: as Pack
  static Counting counted(double v, int n = 1) {
    flops += n;
    return Counting(v);
  }

  Counting& operator+=(Counting b) { return *this = *this + b; }
  Counting& operator-=(Counting b) { return *this = *this - b; }
  Counting& operator*=(Counting b) { return *this = *this * b; }
  Counting& operator/=(Counting b) { return *this = *this / b; }
  friend Counting operator+(Counting a, Counting b) { return counted(a.value + b.value); }
  friend Counting operator-(Counting a, Counting b) { return counted(a.value - b.value); }
  friend Counting operator*(Counting a, Counting b) { return counted(a.value * b.value); }
  friend Counting operator/(Counting a, Counting b) { return counted(a.value / b.value); }
  friend Counting operator-(Counting a) { return Counting(-a.value); }
  friend bool operator<(Counting a, Counting b) { return a.value < b.value; }
  friend bool operator>(Counting a, Counting b) { return a.value > b.value; }
  friend bool operator<=(Counting a, Counting b) { return a.value <= b.value; }
  friend bool operator>=(Counting a, Counting b) { return a.value >= b.value; }
};

inline Counting select(bool mask, Counting a, Counting b) { return mask ? a : b; }
inline int64_t to_bits(Counting a) { return to_bits(a.value); }
inline Counting madd(Counting a, Counting b, Counting c) { return Counting::counted(madd(a.value, b.value, c.value), 2); }
inline Counting nmadd(Counting a, Counting b, Counting c) { return madd(-a, b, c); }
inline Counting msub(Counting a, Counting b, Counting c) { return madd(a, b, -c); }
inline Counting sqrt(Counting a) { return Counting::counted(sqrt(a.value)); }
inline Counting abs(Counting a) { return Counting(abs(a.value)); }
inline double lane(Counting a, int) { return a.value; }
inline void set_lane(Counting& a, int, double v) { a.value = v; }

// Flops of one call of f.
template <class F> double count_flops(F&& f) {
  Counting::flops = 0;
  f();
  return double(Counting::flops);
}

}  // namespace engram

namespace Eigen {
template <> struct NumTraits<engram::Counting> : GenericNumTraits<double> {
  typedef engram::Counting Real;
  typedef engram::Counting NonInteger;
  typedef engram::Counting Nested;
  typedef engram::Counting Literal;
};
template <class Op> struct ScalarBinaryOpTraits<engram::Counting, double, Op> { typedef engram::Counting ReturnType; };
template <class Op> struct ScalarBinaryOpTraits<double, engram::Counting, Op> { typedef engram::Counting ReturnType; };
}  // namespace Eigen

#endif  // BENCH_COUNTING_H_
