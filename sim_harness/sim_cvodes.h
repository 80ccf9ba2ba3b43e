// Integration of smooth systems to rounding, with forward sensitivities: SUNDIALS' CVODES behind one class.
#ifndef ENGRAM_SIM_HARNESS_SIM_CVODES_H_
#define ENGRAM_SIM_HARNESS_SIM_CVODES_H_

#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace engram::sim {

// y' = f(t, y) in R^n, and ns columns s' = (df/dy) s + df/dp of its sensitivities. Adams' methods, errors of y and s controlled.
class Cvodes {
 public:
  using Rhs = std::function<void(double t, const double* y, double* dy)>;
  using SensitivityRhs = std::function<void(double t, const double* y, int column, const double* s, double* ds)>;

  // `tolerance`: relative, and absolute in the units of y.
  Cvodes(int n, double tolerance, Rhs f, int ns = 0, SensitivityRhs fs = nullptr);
  ~Cvodes();
  Cvodes(const Cvodes&) = delete;
  Cvodes& operator=(const Cvodes&) = delete;

  // From t0 to exactly t1 > t0: y (n) and s (ns columns of n, one behind the other) are replaced. Starts anew, as it must where f
  // jumps (a control switches). Returns an empty string, or what CVODES says.
  std::string advance(double t0, double t1, double* y, double* s = nullptr);
  long steps() const { return steps_; }  // inner ones, of all calls

 private:
  struct Memory;
  const int n_, ns_;
  const Rhs f_;
  const SensitivityRhs fs_;
  std::unique_ptr<Memory> m_;
  long steps_ = 0;
};

}  // namespace engram::sim

#endif  // ENGRAM_SIM_HARNESS_SIM_CVODES_H_
