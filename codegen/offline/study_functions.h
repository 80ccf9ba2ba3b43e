// Benchmark functions of thesis 7.5.1 (text lines 1749 to 1800), with gradients, and mixtures of Gaussians as costs.
#ifndef CODEGEN_OFFLINE_STUDY_FUNCTIONS_H_
#define CODEGEN_OFFLINE_STUDY_FUNCTIONS_H_

#include <cmath>
#include <vector>

namespace engram::offline {

// C = 1 - (1 + sin(4 pi |x| / sqrt(d))) / 2 on [-2, 2]^2: optima on circles.
struct Sinusoid {
  double operator()(const double* x, double* gradient) const {
    constexpr double kWave = 4 * 3.14159265358979323846 / 1.41421356237309504880;
    const double radius = std::hypot(x[0], x[1]);
    if (gradient) {
      const double slope = -0.5 * kWave * std::cos(kWave * radius) / std::fmax(radius, 1e-12);
      for (int k = 0; k < 2; ++k) gradient[k] = slope * x[k];
    }
    return 0.5 - 0.5 * std::sin(kWave * radius);
  }
};

// x = (a, b, y_1 .. y_n): C = sum over pairs (y_1 - a)^2 + b (y_2 - y_1^2)^2; one optimum, (a, a^2, a, a^2, ...).
// (The thesis prints y_2k-1 - y_2k^2, but names this optimum.)
struct Rosenbrock {
  int d;
  double operator()(const double* x, double* gradient) const {
    const double a = x[0], b = x[1];
    double c = 0;
    if (gradient) gradient[0] = gradient[1] = 0;
    for (int k = 2; k + 1 < d; k += 2) {
      const double u = x[k] - a, v = x[k + 1] - x[k] * x[k];
      c += u * u + b * v * v;
      if (!gradient) continue;
      gradient[0] -= 2 * u;
      gradient[1] += v * v;
      gradient[k] = 2 * u - 4 * b * v * x[k];
      gradient[k + 1] = 2 * b * v;
    }
    return c;
  }
};

// x = (a, b, y_1, y_2): C = (y_1^2 + y_2 - a)^2 + (y_1 + y_2^2 - b)^2; up to four optima.
struct Himmelblau {
  double operator()(const double* x, double* gradient) const {
    const double u = x[2] * x[2] + x[3] - x[0], v = x[2] + x[3] * x[3] - x[1];
    if (gradient) {
      gradient[0] = -2 * u;
      gradient[1] = -2 * v;
      gradient[2] = 4 * u * x[2] + 2 * v;
      gradient[3] = 2 * u + 4 * v * x[3];
    }
    return u * u + v * v;
  }
};

// P = sum_j a_j exp(-b_j |x - m_j|^2); as a cost -log P, whose minima are the modes, or 1 - P (`plain`), which is flat between them.
struct GaussianMixture {
  int d;
  bool plain;
  std::vector<double> weight, sharpness, mean;  // (J), (J), (J, d)

  double operator()(const double* x, double* gradient) const {
    const int J = int(weight.size());
    double largest = -1e300;
    std::vector<double> exponent(J);
    for (int j = 0; j < J; ++j) {
      double square = 0;
      for (int k = 0; k < d; ++k) square += (x[k] - mean[j * d + k]) * (x[k] - mean[j * d + k]);
      exponent[j] = std::log(weight[j]) - sharpness[j] * square;
      largest = std::fmax(largest, exponent[j]);
    }
    double sum = 0;
    for (double& e : exponent) sum += e = std::exp(e - largest);
    if (gradient) {
      for (int k = 0; k < d; ++k) {
        gradient[k] = 0;
        for (int j = 0; j < J; ++j) gradient[k] += 2 * sharpness[j] * (x[k] - mean[j * d + k]) * exponent[j] / sum;
      }
    }
    const double P = std::exp(largest) * sum;
    if (!plain) return -(largest + std::log(sum));
    for (int k = 0; gradient && k < d; ++k) gradient[k] *= P;
    return 1 - P;
  }
};

}  // namespace engram::offline
#endif  // CODEGEN_OFFLINE_STUDY_FUNCTIONS_H_
