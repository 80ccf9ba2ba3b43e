// The plant of a system that is a formula (pendulum, unicycle, bicopter), integrated to rounding by CVODES.
#ifndef ENGRAM_SIM_HARNESS_SIM_FORMULA_H_
#define ENGRAM_SIM_HARNESS_SIM_FORMULA_H_

#include <memory>
#include <string>

#include "sim_harness/sim_cvodes.h"
#include "sim_harness/sim_model.h"

namespace engram::sim {

// The scene's custom text "formula" names it; its joints are the coordinates, its actuators carry the ranges of the controls.
class Formula {
 public:
  static constexpr double kTolerance = 1e-12;  // of CVODES, in the units of q and v

  // Second order: y = (q, v), v' = rate + push / inertia. First order: y = q, q' = rate.
  struct System {
    const char* name;
    int n, nu, order;
    void (*rate)(const double* q, const double* v, const double* u, double* out);
    double inertia[3];  // of each coordinate, for what pushes from outside
  };

  // Empty string, or why this scene is none.
  std::string init(const Model& model);
  bool ready() const { return system_ != nullptr; }
  // Moves the model's state one time step further under its control and its applied wrenches, both held. Empty string, or what CVODES
  // says. The velocity of a system of first order is its rate at the end of the step.
  std::string step(Model* model);

 private:
  const System* system_ = nullptr;
  double u_[3]{}, push_[3]{};
  std::unique_ptr<Cvodes> cvodes_;
};

}  // namespace engram::sim

#endif  // ENGRAM_SIM_HARNESS_SIM_FORMULA_H_
