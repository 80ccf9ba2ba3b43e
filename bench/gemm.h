// The rate of a fixed-size double matrix product: the limit that arithmetic has on this machine under a build's flags.
#ifndef BENCH_GEMM_H_
#define BENCH_GEMM_H_

#include "bench/stopwatch.h"

#include <Eigen/Core>

namespace bench {

template <int size> std::vector<double> gemm_us(int n) {
  using Matrix = Eigen::Matrix<double, size, size>;
  // static: the largest sizes exceed Eigen's limit for the stack
  alignas(64) static double a[size * size], b[size * size], c[size * size];
  for (int i = 0; i < size * size; ++i) a[i] = b[i] = 1.0 / (1 + i % 7);
  const Eigen::Map<const Matrix, Eigen::AlignedMax> A(a), B(b);
  Eigen::Map<Matrix, Eigen::AlignedMax> C(c);
  constexpr int kBatch = 256 * 256 * 256 / (size * size * size);
  return sample_us(
      n,
      [&] {
        for (int i = 0; i < kBatch; ++i) {
          C.noalias() = A * B;
          keep(c);
        }
      },
      kBatch);
}

// Samples of microseconds per product; a product of n x n matrices is 2 n^3 flops.
inline void report_gemm(Report& report, int n) {
  report.list("gemm64", gemm_us<64>(n));
  report.list("gemm128", gemm_us<128>(n));
  report.list("gemm256", gemm_us<256>(n));
}

}  // namespace bench
#endif  // BENCH_GEMM_H_
