// Pack: kLanes doubles side by side. A lane is one knot, one step length or one candidate; lanes never mix.
//
// All of rbd and ocp is written over a scalar S that is double or Pack, without branches on values: comparisons give masks, and
// select(mask, a, b) picks per lane. GCC and Clang vector extensions keep this portable (AVX2, AVX-512, NEON).
#ifndef CONTROLLER_RBD_RBD_PACK_H_
#define CONTROLLER_RBD_RBD_PACK_H_

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <cstring>
#ifdef __AVX__
#include <immintrin.h>
#endif

// For arithmetic of a few instructions. In long translation units GCC stops inlining what is merely `inline`, and a call costs more
// than the arithmetic (forward kinematics: 2.5 times as long).
#define ENGRAM_INLINE inline __attribute__((always_inline))
#define ENGRAM_INLINE_LAMBDA __attribute__((always_inline))

namespace engram {

#ifndef ENGRAM_LANES
#define ENGRAM_LANES 4
#endif
inline constexpr int kLanes = ENGRAM_LANES;
#if defined(__x86_64__) && ENGRAM_LANES == 8 && !defined(__AVX512F__)
#error "eight lanes need AVX-512: without it they spill out of the registers and run ten times slower"
#endif

struct Pack {
  typedef double Lanes __attribute__((vector_size(kLanes * sizeof(double))));
  typedef int64_t Mask __attribute__((vector_size(kLanes * sizeof(double))));
  Lanes l;

  Pack() = default;
  ENGRAM_INLINE Pack(double s) : l(s - Lanes{}) {}  // NOLINT: broadcasting is meant to be implicit; s - 0 is s, bit for bit
  ENGRAM_INLINE explicit Pack(Lanes lanes) : l(lanes) {}
  ENGRAM_INLINE double operator[](int i) const { return l[i]; }
  ENGRAM_INLINE void set(int i, double s) { l[i] = s; }

  ENGRAM_INLINE Pack& operator+=(Pack b) {
    l += b.l;
    return *this;
  }
  ENGRAM_INLINE Pack& operator-=(Pack b) {
    l -= b.l;
    return *this;
  }
  ENGRAM_INLINE Pack& operator*=(Pack b) {
    l *= b.l;
    return *this;
  }
  ENGRAM_INLINE Pack& operator/=(Pack b) {
    l /= b.l;
    return *this;
  }
  ENGRAM_INLINE friend Pack operator+(Pack a, Pack b) { return Pack(a.l + b.l); }
  ENGRAM_INLINE friend Pack operator-(Pack a, Pack b) { return Pack(a.l - b.l); }
  ENGRAM_INLINE friend Pack operator*(Pack a, Pack b) { return Pack(a.l * b.l); }
  ENGRAM_INLINE friend Pack operator/(Pack a, Pack b) { return Pack(a.l / b.l); }
  ENGRAM_INLINE friend Pack operator-(Pack a) { return Pack(-a.l); }
  ENGRAM_INLINE friend Mask operator<(Pack a, Pack b) { return a.l < b.l; }
  ENGRAM_INLINE friend Mask operator>(Pack a, Pack b) { return a.l > b.l; }
  ENGRAM_INLINE friend Mask operator<=(Pack a, Pack b) { return a.l <= b.l; }
  ENGRAM_INLINE friend Mask operator>=(Pack a, Pack b) { return a.l >= b.l; }
};

// Per lane: mask ? a : b.
ENGRAM_INLINE Pack select(Pack::Mask mask, Pack a, Pack b) { return Pack(mask ? a.l : b.l); }
ENGRAM_INLINE double select(bool mask, double a, double b) { return mask ? a : b; }

template <class S> ENGRAM_INLINE S max(S a, S b) { return select(a > b, a, b); }
template <class S> ENGRAM_INLINE S min(S a, S b) { return select(a < b, a, b); }

// Bit patterns, for the branch-free functions of rbd_math.h.
ENGRAM_INLINE int64_t to_bits(double a) {
  int64_t b;
  std::memcpy(&b, &a, sizeof b);
  return b;
}
ENGRAM_INLINE double from_bits(int64_t b) {
  double a;
  std::memcpy(&a, &b, sizeof a);
  return a;
}
ENGRAM_INLINE Pack::Mask to_bits(Pack a) { return reinterpret_cast<Pack::Mask>(a.l); }
ENGRAM_INLINE Pack from_bits(Pack::Mask b) { return Pack(reinterpret_cast<Pack::Lanes>(b)); }

// a b + c, c - a b and a b - c with one rounding. Said aloud rather than left to the compiler, so that every lane, and the scalar,
// round alike; by intrinsics, since GCC takes a loop over lanes apart in long functions.
ENGRAM_INLINE double madd(double a, double b, double c) {
#ifdef __FP_FAST_FMA
  return __builtin_fma(a, b, c);
#else
  return a * b + c;
#endif
}
ENGRAM_INLINE double nmadd(double a, double b, double c) { return madd(-a, b, c); }
ENGRAM_INLINE double msub(double a, double b, double c) { return madd(a, b, -c); }

#if defined(__AVX512F__) && ENGRAM_LANES == 8
ENGRAM_INLINE Pack madd(Pack a, Pack b, Pack c) { return Pack(Pack::Lanes(_mm512_fmadd_pd(a.l, b.l, c.l))); }
ENGRAM_INLINE Pack nmadd(Pack a, Pack b, Pack c) { return Pack(Pack::Lanes(_mm512_fnmadd_pd(a.l, b.l, c.l))); }
ENGRAM_INLINE Pack msub(Pack a, Pack b, Pack c) { return Pack(Pack::Lanes(_mm512_fmsub_pd(a.l, b.l, c.l))); }
ENGRAM_INLINE Pack sqrt(Pack a) { return Pack(Pack::Lanes(_mm512_sqrt_pd(a.l))); }
#elif defined(__FMA__) && ENGRAM_LANES == 4
ENGRAM_INLINE Pack madd(Pack a, Pack b, Pack c) { return Pack(Pack::Lanes(_mm256_fmadd_pd(a.l, b.l, c.l))); }
ENGRAM_INLINE Pack nmadd(Pack a, Pack b, Pack c) { return Pack(Pack::Lanes(_mm256_fnmadd_pd(a.l, b.l, c.l))); }
ENGRAM_INLINE Pack msub(Pack a, Pack b, Pack c) { return Pack(Pack::Lanes(_mm256_fmsub_pd(a.l, b.l, c.l))); }
ENGRAM_INLINE Pack sqrt(Pack a) { return Pack(Pack::Lanes(_mm256_sqrt_pd(a.l))); }
#else
ENGRAM_INLINE Pack madd(Pack a, Pack b, Pack c) {
  Pack r;
  for (int i = 0; i < kLanes; ++i) r.l[i] = madd(a.l[i], b.l[i], c.l[i]);
  return r;
}
ENGRAM_INLINE Pack nmadd(Pack a, Pack b, Pack c) { return madd(-a, b, c); }
ENGRAM_INLINE Pack msub(Pack a, Pack b, Pack c) { return madd(a, b, -c); }
ENGRAM_INLINE Pack sqrt(Pack a) {
  Pack r;
  for (int i = 0; i < kLanes; ++i) r.l[i] = std::sqrt(a.l[i]);
  return r;
}
#endif

ENGRAM_INLINE double sqrt(double a) { return std::sqrt(a); }
ENGRAM_INLINE double abs(double a) { return std::fabs(a); }
ENGRAM_INLINE Pack abs(Pack a) { return from_bits(to_bits(a) & INT64_MAX); }

// Neighbouring doubles as lanes.
ENGRAM_INLINE Pack load_pack(const double* from) {
  Pack a;
  std::memcpy(&a, from, sizeof a);
  return a;
}
ENGRAM_INLINE void store_pack(Pack a, double* to) { std::memcpy(to, &a, sizeof a); }

// How many values a scalar carries, and lane access that also works on double.
template <class S> inline constexpr int lanes_of = 1;
template <> inline constexpr int lanes_of<Pack> = kLanes;
ENGRAM_INLINE double lane(double a, int) { return a; }
ENGRAM_INLINE double lane(Pack a, int i) { return a.l[i]; }
ENGRAM_INLINE void set_lane(double& a, int, double s) { a = s; }
ENGRAM_INLINE void set_lane(Pack& a, int i, double s) { a.l[i] = s; }

}  // namespace engram

namespace Eigen {
template <> struct NumTraits<engram::Pack> : GenericNumTraits<double> {
  typedef engram::Pack Real;
  typedef engram::Pack NonInteger;
  typedef engram::Pack Nested;
  typedef engram::Pack Literal;
  enum { IsComplex = 0, IsInteger = 0, IsSigned = 1, RequireInitialization = 0, ReadCost = 1, AddCost = 1, MulCost = 1 };
};
template <class Op> struct ScalarBinaryOpTraits<engram::Pack, double, Op> { typedef engram::Pack ReturnType; };
template <class Op> struct ScalarBinaryOpTraits<double, engram::Pack, Op> { typedef engram::Pack ReturnType; };
}  // namespace Eigen

#endif  // CONTROLLER_RBD_RBD_PACK_H_
