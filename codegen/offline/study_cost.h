// A cost C(x) >= 0 over a box: what tensor trains are built from, and what starts are refined on. The first `ntask` variables are the
// task, the others are decided.
#ifndef CODEGEN_OFFLINE_STUDY_COST_H_
#define CODEGEN_OFFLINE_STUDY_COST_H_

#include "codegen/offline/bounded_bfgs.h"

#include <cmath>
#include <cstddef>
#include <vector>

namespace engram::offline {

class StudyCost {
 public:
  virtual ~StudyCost() = default;
  int d() const { return int(lo.size()); }

  // C at m points x (m, d); gradient (m, d) unless null
  virtual void evaluate(const double* x, std::size_t m, double* c, double* gradient) const = 0;
  // The density a train is built of, at m points (thesis 7.5).
  void density(const double* x, std::size_t m, double* p) const {
    evaluate(x, m, p, nullptr);
    for (std::size_t i = 0; i < m; ++i) {
      const double c = p[i];
      p[i] = complement ? 1 - c : std::exp(-(power == 1 ? scale * c : scale * scale * c * c));
    }
  }
  // Moves the variables behind the task downhill, in place, with at most `evaluations` of cost and gradient; what costs no more than
  // `enough` need not move on. c (m): where it ends.
  virtual void refine(double* x, std::size_t m, int evaluations, double enough, double* c) const = 0;

  std::vector<double> lo, hi;
  int ntask = 0;
  bool complement = false;  // density 1 - C instead of exp(-(scale C)^power)
  double scale = 1.0;
  int power = 2;  // 1 or 2
};

// From a function object F: S F::operator()(const S* x, S* gradient), with a null gradient where it is not asked for.
template <class F, class S> class StudyCostOf : public StudyCost {
 public:
  explicit StudyCostOf(F f) : f_(std::move(f)) {}

  void evaluate(const double* x, std::size_t m, double* c, double* gradient) const override {
    std::vector<S> at(d()), g(d());
    for (std::size_t i = 0; i < m; i += lanes_of<S>) {
      load(x, m, i, at.data());
      const S value = f_(at.data(), gradient ? g.data() : nullptr);
      for (std::size_t l = 0; l < lanes_of<S> && i + l < m; ++l) {
        c[i + l] = lane(value, int(l));
        if (!gradient) continue;
        for (int k = 0; k < d(); ++k) gradient[(i + l) * d() + k] = lane(g[k], int(l));
      }
    }
  }

  void refine(double* x, std::size_t m, int evaluations, double enough, double* c) const override {
    std::vector<S> at(d());
    for (std::size_t i = 0; i < m; i += lanes_of<S>) {
      load(x, m, i, at.data());
      const S value = bounded_bfgs<S>(f_, lo, hi, ntask, evaluations, enough, at.data());
      for (std::size_t l = 0; l < lanes_of<S> && i + l < m; ++l) {
        c[i + l] = lane(value, int(l));
        for (int k = ntask; k < d(); ++k) x[(i + l) * d() + k] = lane(at[k], int(l));
      }
    }
  }

 private:
  // Points i, i + 1, ... as lanes; beyond the last one, the last again.
  void load(const double* x, std::size_t m, std::size_t i, S* at) const {
    for (std::size_t l = 0; l < lanes_of<S>; ++l)
      for (int k = 0; k < d(); ++k) set_lane(at[k], int(l), x[std::min(i + l, m - 1) * d() + k]);
  }

  F f_;
};

}  // namespace engram::offline
#endif  // CODEGEN_OFFLINE_STUDY_COST_H_
