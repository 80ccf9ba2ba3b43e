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
  double torque[3]{};   // N m, world axes
  double duration = 0;  // s
  bool smooth = false;  // a gust: grows and fades as (1 - cos) / 2

  double share(double now) const;  // of force and torque, at a time
};

// Pushes out of nowhere, at times of a Poisson process.
struct RandomPushes {
  double period = 0;      // s, mean time between two; 0: none
  double force = 0;       // N, the largest
  double duration = 0.1;  // s
  bool smooth = false;
  double next = 0;        // s, of the next one
};

struct FaultOptions {
  uint64_t seed = 1;
  double noise_q = 0;                 // standard deviation of measured joint positions (rad or m)
  double noise_v = 0;                 // standard deviation of measured velocities (rad/s or m/s)
  int latency = 0;                    // plant steps from a command to its effect
  std::vector<std::string> pushes;    // "t,body,fx,fy,fz,duration"
  RandomPushes random_push;           // on any moving body
  RandomPushes gust;                  // wind
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
  // A push to come, t counted from `now`.
  void add(Push push, double now);
  // Sets the external forces of time t.
  void push(Model* model, double t);

 private:
  void strike(RandomPushes* random, const Model& model, double t);

  FaultOptions options_;
  std::mt19937_64 random_;
  std::normal_distribution<double> normal_;
  std::deque<std::vector<double>> queue_;
  std::vector<double> now_;
  std::vector<Push> pushes_;
};

}  // namespace engram::sim

#endif  // ENGRAM_SIM_HARNESS_SIM_FAULTS_H_
