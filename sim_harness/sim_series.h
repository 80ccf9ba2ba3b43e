// A task series: what the robot is asked to do during a run. Written by `engram demo` from a seed, read by the plant.
//
//   engram_series 1                    format and version, first line
//   robot_digest 0x...                 digest of tables/<robot>/robot.h
//   task_digest 0x...                  digest of tables/<robot>_<task>/task.h
//   hand <site>                        MJCF site that is judged
//   window <s>                         a jump must arrive within this time
//   hold <s>                           and stay for this time
//   tolerance <m> <rad>                within this distance
//   speed v...                         limits of the velocities (nv numbers, convention of state_t); optional
//   episode q...                       the robot is put here, at rest (nq numbers, convention of state_t)
//   jump  px py pz x y z w  value...   target of the hand (m, unit quaternion) and the task vector of the same target
//   move  dt  px py pz x y z w  value...   after the jump before it has ended: the target dt seconds later
//
// Empty lines and lines that start with # are skipped. Numbers in C notation, hexadecimal floats included.
#ifndef ENGRAM_SIM_HARNESS_SIM_SERIES_H_
#define ENGRAM_SIM_HARNESS_SIM_SERIES_H_

#include <cstdint>
#include <string>
#include <vector>

#include "sim_harness/sim_script.h"

namespace engram::sim {

struct Target {
  double dt = 0;  // s after the target before it; 0 for a jump
  Pose pose{};
  std::vector<double> value;  // task vector
};

struct Jump {
  Target target;
  std::vector<Target> moves;  // continuous motion of the target once the jump has ended
};

struct Episode {
  std::vector<double> q;  // start posture (nq)
  std::vector<Jump> jumps;
};

struct Series {
  uint64_t robot_digest = 0, task_digest = 0;
  std::string hand;
  double window = 3.0, hold = 0.3;   // s
  double position_tolerance = 0.01;  // m
  double rotation_tolerance = 0.1;   // rad
  std::vector<double> speed;         // velocity limits (nv), or empty
  std::vector<Episode> episodes;

  int jump_count() const;
  // Returns an empty string, or one line with file, line number, what is wrong and what to do.
  std::string read(const char* path, int nq, int nv);
};

}  // namespace engram::sim

#endif  // ENGRAM_SIM_HARNESS_SIM_SERIES_H_
