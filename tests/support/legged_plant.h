// A robot on legs in MuJoCo, in this process and in lock step with its controller behind the door: for closed-loop tests and proofs.
#ifndef TESTS_SUPPORT_LEGGED_PLANT_H_
#define TESTS_SUPPORT_LEGGED_PLANT_H_

#include <mujoco/mujoco.h>

#include <map>
#include <string>
#include <vector>

#include "controller/engram.h"

namespace engram::test {

// The scene of a model's task, one step per millisecond. Coordinates at its door are those of engram.h.
class LeggedPlant {
 public:
  static constexpr int64_t kStepUs = 1000;

  // At the home posture, turned about the world's z axis by `heading` [rad].
  LeggedPlant(const engram_model* model, double heading);
  ~LeggedPlant();
  LeggedPlant(const LeggedPlant&) = delete;
  LeggedPlant& operator=(const LeggedPlant&) = delete;

  void step(const double* tau);
  // Force [N], world axes, at the centre of mass of a body from now on.
  void push(const char* body, const double (&force)[3]);
  // What the controller does not know of: a mass [kg] at the centre of mass of a body; friction of the ground; commands that act `delay`
  // steps late; ground under the sole that is higher than elsewhere by so much [m], to be changed while the foot is in the air.
  void add_mass(const char* body, double mass);
  void friction(double mu);
  void delay(int steps);
  void raise_ground(const char* sole, double height);

  int64_t utime = 0;
  std::vector<double> q, v;  // measured
  double com[3], com_velocity[3];
  double base_up() const;  // cosine of the base's tilt
  double yaw() const;      // heading of the base [rad]
  const mjModel* model() const { return m_; }
  const mjData* data() const { return d_; }

 private:
  void measure();
  mjModel* m_ = nullptr;
  mjData* d_ = nullptr;
  int64_t delay_ = 0, steps_ = 0;
  std::vector<double> under_way_;         // ring of the last 1 + delay commands
  std::map<std::string, double> ground_;  // m, of each sole that is not on level ground
};

// A controller in memory of its own, and one millisecond of the closed loop.
class LeggedController {
 public:
  explicit LeggedController(const engram_model* model, const engram_options* options = nullptr);
  engram_error error;
  engram_controller* handle = nullptr;
  std::vector<double> tau;

  // Feedback at a tick, command, the plant's step, plan for the next tick. Returns the command's status.
  engram_status step(LeggedPlant& plant);
  const engram_cycle& cycle() const { return cycle_; }

 private:
  std::vector<unsigned char> memory_;
  engram_cycle cycle_ = {};
};

}  // namespace engram::test
#endif  // TESTS_SUPPORT_LEGGED_PLANT_H_
