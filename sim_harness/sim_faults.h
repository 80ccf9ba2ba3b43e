// What the real world adds, all from one seed: sensor noise, late commands, pushes.
#ifndef ENGRAM_SIM_HARNESS_SIM_FAULTS_H_
#define ENGRAM_SIM_HARNESS_SIM_FAULTS_H_

#include <cstdint>
#include <deque>
#include <random>
#include <string>
#include <vector>

#include "sim_harness/sim_model.h"

namespace engram::sim {

struct Push {
  double t = 0;         // s, plant clock
  int body = 0;         // MuJoCo body; the force acts at its centre of mass
  double force[3]{};    // N, world axes
  double duration = 0;  // s
};

struct FaultOptions {
  uint64_t seed = 1;
  double noise_q = 0;                 // standard deviation of measured joint positions (rad or m)
  double noise_v = 0;                 // standard deviation of measured velocities (rad/s or m/s)
  int latency = 0;                    // plant steps from a command to its effect
  std::vector<std::string> pushes;    // "t,body,fx,fy,fz,duration"
  double random_push_period = 0;      // s, mean time between random pushes; 0: none
  double random_push_force = 0;       // N
  double random_push_duration = 0.1;  // s
};

class Faults {
 public:
  std::string init(const FaultOptions& options, const Model& model);  // empty string, or what is wrong

  // Adds noise to joint positions and to all velocities. A free base's pose stays exact.
  void measure(const Model& model, double* q, double* v);
  // Takes the command of this step and returns the one that acts now. The first `latency` steps hold against gravity.
  const double* delay(const Model& model, const double* tau);
  // The robot was put elsewhere: commands under way are of no use any more.
  void restart() { queue_.clear(); }
  // Sets the external forces of time t.
  void push(Model* model, double t);

 private:
  FaultOptions options_;
  std::mt19937_64 random_;
  std::normal_distribution<double> normal_;
  std::deque<std::vector<double>> queue_;
  std::vector<double> now_;
  std::vector<Push> pushes_;
  double next_random_push_ = 0;
};

}  // namespace engram::sim

#endif  // ENGRAM_SIM_HARNESS_SIM_FAULTS_H_
