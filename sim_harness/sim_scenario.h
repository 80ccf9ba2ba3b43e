// A scenario: episodes that a robot must get through on its feet. Written by `engram demo` from a seed, read by the plant.
//
//   engram_scenario 1                  format and version, first line
//   robot_digest 0x...                 digest of tables/<robot>/robot.h
//   task_digest 0x...                  digest of tables/<robot>_<task>/task.h
//   episode <name> <s>                 an episode of this length; the lines below belong to it, times count from its beginning
//   state q...                         the robot is put here, at rest (nq numbers, convention of state_t)
//   task t value...                    from time t on this is the task
//   push t d <body> fx fy fz [tx ty tz]   force (N) on a body's centre of mass and torque (N m), world axes, from t on for d seconds
//   gust t d <body> fx fy fz [tx ty tz]   the same, but it grows and fades: (1 - cos(2 pi s)) / 2 of the force at share s
//   upright h a                        fallen, once the base is lower than h (m) or tilted by more than a (rad)
//   drift t m                          from t on the centre of mass stays within m metres of where it was at t
//   height t m  z d f                  from t on its height follows, with an rms error of m metres, height of the episode's first state
//                                      + z - d (1 - cos(2 pi f s)) / 2, s: time since the last task
//   pace t m  vx vy wz                 from t on to the end the base's mean velocity, in axes of its first heading, and its turning rate
//                                      are these within m (m/s, rad/s)
//   reach t m <site> x y z             from t to the next task, or to the end, a site of the robot stays within m metres of this point
//                                      (m, world axes); may be repeated, in order of t
//   clear <geom>                       the robot never touches this geom of the world
//
// Empty lines and lines that start with # are skipped. Numbers in C notation, hexadecimal floats included.
#ifndef ENGRAM_SIM_HARNESS_SIM_SCENARIO_H_
#define ENGRAM_SIM_HARNESS_SIM_SCENARIO_H_

#include <cstdint>
#include <string>
#include <vector>

#include "sim_harness/sim_script.h"

namespace engram::sim {

// A demand on an episode from time t on.
struct Demand {
  double t = -1;      // s; -1: not asked for
  double bound = 0;   // m, m/s
  double want[3]{};
  bool asked() const { return t >= 0; }
};

// A demand that holds until the next task sets in.
struct Reach : Demand {
  int site = -1;
  double end = 0;  // s
};

struct TimedTask {
  double t = 0;  // s
  std::vector<double> value;
};

struct Trial {
  std::string name;
  double duration = 0;  // s
  std::vector<double> q;
  std::vector<TimedTask> tasks;  // in order of time
  std::vector<Push> pushes;
  double lowest = 0, tilt = 4;  // m, rad
  Demand drift, height, pace;
  std::vector<Reach> reach;
  int clear = -1;   // geom; -1: not asked for
};

struct Scenario {
  uint64_t robot_digest = 0, task_digest = 0;
  std::vector<Trial> trials;

  // Returns an empty string, or one line with file, line number, what is wrong and what to do.
  std::string read(const char* path, const Model& model);
};

// What was measured in one episode.
struct TrialRecord {
  double t_start = 0, t_end = 0;  // s, plant clock
  bool fallen = false;
  double lowest = 1e9;     // m, of the base
  double tilt = 0;         // rad, largest
  double drift = 0;        // m, largest distance since Demand::t
  double height_sum = 0;   // m^2, sum of squared errors
  long height_steps = 0;
  double pace[3]{};        // m/s, rad/s
  std::vector<double> reach;  // m, largest distance of each Reach
  bool touched = false;
  double joint_excess = 0, torque_share = 0;
  int statuses[kMaxStatus] = {};

  double height_rms() const;
  // How many points were reached: those whose time has come, and whose bound was kept.
  int reached(const Trial& trial) const;
};

// Runs a scenario and judges it.
class Referee : public Script {
 public:
  explicit Referee(const Scenario& scenario) : scenario_(scenario) {}
  Event begin_step(double t) override;
  std::string look(const Model& model, double t) override;
  void command(double torque_share, int status) override;
  bool finished() const override { return trial_ == scenario_.trials.size(); }
  void write(std::FILE* file) const override;

  const std::vector<TrialRecord>& records() const { return records_; }
  // "ok", or what failed, joined by '+': fall, drift, height, pace, reach, touch, limit.
  static std::string reason(const Trial& trial, const TrialRecord& record);

 private:
  void measure(const Trial& trial, const Model& model, double since, TrialRecord* record);

  const Scenario& scenario_;
  size_t trial_ = 0, task_ = 0;
  bool running_ = false;
  int jump_ = 0;
  double last_task_ = 0;                // s, since the beginning of the episode
  double first_height_ = 0;             // m, centre of mass
  double anchor_[3]{};                  // m, centre of mass at drift.t
  double from_[2]{}, from_yaw_ = 0, first_yaw_ = 0, yaw_ = 0;  // m, rad: base at pace.t; heading first and now, unwound
  std::vector<TrialRecord> records_;
};

}  // namespace engram::sim

#endif  // ENGRAM_SIM_HARNESS_SIM_SCENARIO_H_
