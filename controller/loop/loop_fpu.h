// Subnormal numbers cost tens of cycles each and mean nothing here: flush them to zero while the controller computes, and leave the
// caller's floating-point mode as it was. Every entry of engram.h does so, hence flight, tests and offline solves agree.
#ifndef CONTROLLER_LOOP_LOOP_FPU_H_
#define CONTROLLER_LOOP_LOOP_FPU_H_

#include <cstdint>
#ifdef __SSE2__
#include <xmmintrin.h>
#endif

namespace engram {

class FlushSubnormals {
 public:
#if defined(__SSE2__)
  FlushSubnormals() : before_(_mm_getcsr()) { _mm_setcsr(before_ | 0x8040); }  // flush to zero, subnormals are zero
  ~FlushSubnormals() { _mm_setcsr(before_); }

 private:
  uint32_t before_;

 public:
#elif defined(__aarch64__)
  FlushSubnormals() {
    asm volatile("mrs %0, fpcr" : "=r"(before_));
    asm volatile("msr fpcr, %0" : : "r"(before_ | uint64_t{1} << 24));  // FZ
  }
  ~FlushSubnormals() { asm volatile("msr fpcr, %0" : : "r"(before_)); }

 private:
  uint64_t before_;

 public:
#else
  FlushSubnormals() = default;
#endif
  FlushSubnormals(const FlushSubnormals&) = delete;
  FlushSubnormals& operator=(const FlushSubnormals&) = delete;
};

}  // namespace engram
#endif  // CONTROLLER_LOOP_LOOP_FPU_H_
