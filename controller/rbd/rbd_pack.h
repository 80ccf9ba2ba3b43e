// Real, the scalar of rbd, ocp and fddp, and Pack: kLanes of them side by side. A lane is one knot, one step length or one candidate;
// lanes never mix.
//
// All of rbd and ocp is written over a scalar S that is Real or Pack, without branches on values: comparisons give masks, and
// select(mask, a, b) picks per lane. The one exception is any(mask), where all lanes may be spared what adds nothing. GCC and Clang vector extensions keep this portable (AVX2, AVX-512, NEON).
//
// Real is double. A program compiled with ENGRAM_SINGLE computes in float, twice as many lanes at once; it is one choice for all of a
// program, as ENGRAM_LANES is. Robots' constants, options, times and what the loop stores stay double.
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
#ifdef __SANITIZE_ADDRESS__  // checks of every access make functions that are inlined by force take minutes to compile
#define ENGRAM_INLINE inline
#define ENGRAM_INLINE_LAMBDA
#else
#define ENGRAM_INLINE inline __attribute__((always_inline))
#define ENGRAM_INLINE_LAMBDA __attribute__((always_inline))
#endif

namespace engram {

#ifndef ENGRAM_LANES
#define ENGRAM_LANES 4
#endif
#ifdef ENGRAM_SINGLE
using Real = float;
using Bits = int32_t;
#else
using Real = double;
using Bits = int64_t;
#endif
inline constexpr int kPackBytes = ENGRAM_LANES * sizeof(double);  // ENGRAM_LANES counts doubles
inline constexpr int kLanes = kPackBytes / sizeof(Real);
#if defined(__x86_64__) && ENGRAM_LANES == 8 && !defined(__AVX512F__)
#error "eight lanes need AVX-512: without it they spill out of the registers and run ten times slower"
#endif

struct Pack {
  typedef Real Lanes __attribute__((vector_size(kPackBytes)));
  typedef Bits Mask __attribute__((vector_size(kPackBytes)));
  Lanes l;

  Pack() = default;
  ENGRAM_INLINE Pack(Real s) : l(s - Lanes{}) {}  // NOLINT: broadcasting is meant to be implicit; s - 0 is s, bit for bit
  ENGRAM_INLINE explicit Pack(Lanes lanes) : l(lanes) {}
  ENGRAM_INLINE Real operator[](int i) const { return l[i]; }
  ENGRAM_INLINE void set(int i, Real s) { l[i] = s; }

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
ENGRAM_INLINE Real select(bool mask, Real a, Real b) { return mask ? a : b; }

// Whether the mask holds in any lane: for work that only adds zeros where it does not. The result must be the same either way.
ENGRAM_INLINE bool any(bool mask) { return mask; }
ENGRAM_INLINE bool any(Pack::Mask mask) {
#if defined(__AVX__) && ENGRAM_LANES == 4
  const __m256i lanes = reinterpret_cast<__m256i>(mask);
  return !_mm256_testz_si256(lanes, lanes);
#endif
  Bits bits = 0;
  for (int i = 0; i < kLanes; ++i) bits |= mask[i];
  return bits != 0;
}

template <class S> ENGRAM_INLINE S max(S a, S b) { return select(a > b, a, b); }
template <class S> ENGRAM_INLINE S min(S a, S b) { return select(a < b, a, b); }

// Bit patterns, for the branch-free functions of rbd_math.h.
ENGRAM_INLINE Bits to_bits(Real a) {
  Bits b;
  std::memcpy(&b, &a, sizeof b);
  return b;
}
ENGRAM_INLINE Real from_bits(Bits b) {
  Real a;
  std::memcpy(&a, &b, sizeof a);
  return a;
}
ENGRAM_INLINE Pack::Mask to_bits(Pack a) { return reinterpret_cast<Pack::Mask>(a.l); }
ENGRAM_INLINE Pack from_bits(Pack::Mask b) { return Pack(reinterpret_cast<Pack::Lanes>(b)); }

// a b + c, c - a b and a b - c with one rounding. Said aloud rather than left to the compiler, so that every lane, and the scalar,
// round alike; by intrinsics, since GCC takes a loop over lanes apart in long functions.
ENGRAM_INLINE Real madd(Real a, Real b, Real c) {
#ifdef __FP_FAST_FMA
  return std::fma(a, b, c);
#else
  return a * b + c;
#endif
}
ENGRAM_INLINE Real nmadd(Real a, Real b, Real c) { return madd(-a, b, c); }
ENGRAM_INLINE Real msub(Real a, Real b, Real c) { return madd(a, b, -c); }

#if defined(__AVX512F__) && ENGRAM_LANES == 8
#define ENGRAM_INTRINSIC(name, precision) _mm512_##name##_##precision
#elif defined(__FMA__) && ENGRAM_LANES == 4
#define ENGRAM_INTRINSIC(name, precision) _mm256_##name##_##precision
#endif
#ifdef ENGRAM_INTRINSIC
#ifdef ENGRAM_SINGLE
#define ENGRAM_ON_PACK(name) ENGRAM_INTRINSIC(name, ps)
#else
#define ENGRAM_ON_PACK(name) ENGRAM_INTRINSIC(name, pd)
#endif
ENGRAM_INLINE Pack madd(Pack a, Pack b, Pack c) { return Pack(Pack::Lanes(ENGRAM_ON_PACK(fmadd)(a.l, b.l, c.l))); }
ENGRAM_INLINE Pack nmadd(Pack a, Pack b, Pack c) { return Pack(Pack::Lanes(ENGRAM_ON_PACK(fnmadd)(a.l, b.l, c.l))); }
ENGRAM_INLINE Pack msub(Pack a, Pack b, Pack c) { return Pack(Pack::Lanes(ENGRAM_ON_PACK(fmsub)(a.l, b.l, c.l))); }
ENGRAM_INLINE Pack sqrt(Pack a) { return Pack(Pack::Lanes(ENGRAM_ON_PACK(sqrt)(a.l))); }
#undef ENGRAM_ON_PACK
#undef ENGRAM_INTRINSIC
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

ENGRAM_INLINE Real sqrt(Real a) { return std::sqrt(a); }
ENGRAM_INLINE Real abs(Real a) { return std::fabs(a); }
ENGRAM_INLINE Pack abs(Pack a) { return from_bits(to_bits(a) & (sizeof(Bits) == 8 ? Bits(INT64_MAX) : Bits(INT32_MAX))); }

// Neighbouring doubles as lanes.
ENGRAM_INLINE Pack load_pack(const Real* from) {
  Pack a;
  std::memcpy(&a, from, sizeof a);
  return a;
}
ENGRAM_INLINE void store_pack(Pack a, Real* to) { std::memcpy(to, &a, sizeof a); }

// How many values a scalar carries, and lane access that also works on Real.
template <class S> inline constexpr int lanes_of = 1;
template <> inline constexpr int lanes_of<Pack> = kLanes;
ENGRAM_INLINE Real lane(Real a, int) { return a; }
ENGRAM_INLINE Real lane(Pack a, int i) { return a.l[i]; }
ENGRAM_INLINE void set_lane(Real& a, int, Real s) { a = s; }
ENGRAM_INLINE void set_lane(Pack& a, int i, Real s) { a.l[i] = s; }

}  // namespace engram

namespace Eigen {
template <> struct NumTraits<engram::Pack> : GenericNumTraits<engram::Real> {
  typedef engram::Pack Real;
  typedef engram::Pack NonInteger;
  typedef engram::Pack Nested;
  typedef engram::Pack Literal;
  enum { IsComplex = 0, IsInteger = 0, IsSigned = 1, RequireInitialization = 0, ReadCost = 1, AddCost = 1, MulCost = 1 };
};
template <class Op> struct ScalarBinaryOpTraits<engram::Pack, engram::Real, Op> { typedef engram::Pack ReturnType; };
template <class Op> struct ScalarBinaryOpTraits<engram::Real, engram::Pack, Op> { typedef engram::Pack ReturnType; };
}  // namespace Eigen

#endif  // CONTROLLER_RBD_RBD_PACK_H_
