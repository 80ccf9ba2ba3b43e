// The plant of a craft that flies: one free body on thrusters, integrated to rounding by CVODES instead of MuJoCo's steps.
#ifndef ENGRAM_SIM_HARNESS_SIM_FLIGHT_H_
#define ENGRAM_SIM_HARNESS_SIM_FLIGHT_H_

#include <memory>
#include <string>

#include "sim_harness/sim_cvodes.h"
#include "sim_harness/sim_model.h"

namespace engram::sim {

// p' = v,  quat' = quat w / 2,  m v' = m g + R f + F,  I w' = t + R' T - w x I w
// with p of the centre of mass and w in its principal axes. f, t: wrench of the thrusters; F, T: applied from outside (xfrc_applied).
// Mass, inertia and thrusters are the scene's.
class Flight {
 public:
  static constexpr double kTolerance = 1e-12;  // of CVODES, in m, m/s, 1, rad/s

  // Empty string, or why this scene is not one free body.
  std::string init(const Model& model);
  // Moves the model's state one time step further under its control and its applied wrench, both held: a control that switches is a
  // stop of the integrator. Empty string, or what CVODES says.
  std::string step(Model* model);

 private:
  double mass_ = 0, inertia_[3]{}, gravity_[3]{};
  double ipos_[3]{}, iquat_[4]{};            // of the centre of mass in the body
  double force_[3]{}, torque_[3]{};          // of the thrusters, principal axes
  double push_[3]{}, twist_[3]{};            // from outside, world axes
  std::unique_ptr<Cvodes> cvodes_;
};

}  // namespace engram::sim

#endif  // ENGRAM_SIM_HARNESS_SIM_FLIGHT_H_
