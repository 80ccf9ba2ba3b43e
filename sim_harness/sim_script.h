// What a run consists of: a script puts the robot somewhere, says what it shall do and what befalls it, and judges what came of it.
#ifndef ENGRAM_SIM_HARNESS_SIM_SCRIPT_H_
#define ENGRAM_SIM_HARNESS_SIM_SCRIPT_H_

#include <cstdio>
#include <string>
#include <vector>

#include "sim_harness/sim_faults.h"
#include "sim_harness/sim_model.h"

namespace engram::sim {

constexpr int kMaxTask = 32;  // entries of task_t.value
constexpr int kMaxStatus = 32;

// A robot counts as beyond its limits when more than rounding and softness of the simulation is left.
// A joint rests some tenths of a milliradian inside MuJoCo's soft limit; beyond this the limit counts as broken.
constexpr double kJointTolerance = 1e-3;  // rad or m
// Torques are clamped by the controller to the very limit: no more than rounding may be left.
constexpr double kTorqueTolerance = 1e-9;  // 1, of the limit

class Script {
 public:
  // What happens before the state of time t is published. A robot that is put somewhere is like a plant that restarts: its first
  // state goes out alone, the first task comes with the second.
  struct Event {
    const std::vector<double>* reset = nullptr;   // put the robot there, at rest (nq)
    const std::vector<double>* task = nullptr;    // publish this task vector
    const std::vector<Push>* pushes = nullptr;    // to come, times counted from now
    int jump = 0;                                 // jump counter
  };
  virtual ~Script() = default;
  virtual Event begin_step(double t) = 0;
  // Judges the state of time t (positions and contacts are computed). One line when a part of the script has ended, else "".
  virtual std::string look(const Model& model, double t) = 0;
  // Books the command that answered the state of time t.
  virtual void command(double torque_share, int status) = 0;
  virtual bool finished() const = 0;
  // "jumps": [...] or "episodes": [...], for the results.
  virtual void write(std::FILE* file) const = 0;
};

// {"0": 12, "3": 1}: plant steps by status of their command, those that occurred.
void write_statuses(std::FILE* file, const int (&statuses)[kMaxStatus]);

}  // namespace engram::sim

#endif  // ENGRAM_SIM_HARNESS_SIM_SCRIPT_H_
