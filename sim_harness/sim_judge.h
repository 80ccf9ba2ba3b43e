// Runs a task series and judges it: which target holds now, and how each jump ended.
#ifndef ENGRAM_SIM_HARNESS_SIM_JUDGE_H_
#define ENGRAM_SIM_HARNESS_SIM_JUDGE_H_

#include <cstdio>
#include <string>
#include <vector>

#include "sim_harness/sim_model.h"
#include "sim_harness/sim_series.h"

namespace engram::sim {

// A joint rests some tenths of a milliradian inside MuJoCo's soft limit; beyond this the limit counts as broken.
constexpr double kJointTolerance = 1e-3;  // rad or m
// Torques are clamped by the controller to the very limit: no more than rounding may be left.
constexpr double kTorqueTolerance = 1e-9;  // 1, of the limit
// A velocity limit is a barrier of the optimal control problem, not a clamp: the fast feedback may brush it.
constexpr double kSpeedTolerance = 0.02;  // 1, of the limit
constexpr int kMaxStatus = 32;

// How one jump ended. Times in s of the plant clock unless stated.
struct JumpRecord {
  int episode = 0;  // counts from 1
  int jump = 0;     // counts from 1 over the series
  double t_start = 0, t_end = 0;
  double arrival = -1;            // s after the jump at which the hold began, -1: never held
  double contact_time = -1;       // s after the jump of the first robot-world contact, -1: none
  std::string contact;            // the two geoms
  double joint_excess = 0;        // rad or m beyond a joint's range
  double speed_share = 0;         // largest |v| / limit
  double torque_share = 0;        // largest |tau| / limit
  double position_error = 0;      // m at the end
  double rotation_error = 0;      // rad at the end
  int statuses[kMaxStatus] = {};  // plant steps by status of their command (engram_status); others in the last
  int move_steps = 0;             // plant steps of the continuous motion after the jump
  double move_error_sum = 0;      // m, sum over move_steps
  double move_error_max = 0;      // m
  bool move_contact = false;

  bool late() const { return arrival < 0; }
  bool limit() const {
    return joint_excess > kJointTolerance || speed_share > 1 + kSpeedTolerance || torque_share > 1 + kTorqueTolerance;
  }
  bool success() const { return !late() && contact_time < 0 && !limit(); }
  std::string reason() const;  // "ok", or what failed, joined by '+': late, contact, limit
};

class Judge {
 public:
  explicit Judge(const Series& series) : series_(series) {}

  // What happens before the state of time t is published. An episode begins like a plant that restarts: the robot is put
  // somewhere, its first state goes out alone, the first task comes with the second.
  struct Event {
    const Episode* reset = nullptr;  // put the robot there
    const Target* task = nullptr;    // publish it
    int jump = 0;                    // its jump counter
  };
  Event begin_step(double t);

  // Judges the state of time t. Needs its positions and contacts (mj_step1). Returns the record of a jump that ended now, or
  // nullptr.
  const JumpRecord* judge(const Model& model, double t);
  // Books the command that answered the state of time t.
  void command(double torque_share, int status);

  bool finished() const { return phase_ == Phase::kFinished; }
  const std::vector<JumpRecord>& records() const { return records_; }

 private:
  enum class Phase { kNextEpisode, kNextJump, kJump, kMove, kFinished };
  const Jump& jump() const { return series_.episodes[episode_].jumps[jump_in_episode_]; }
  void advance();

  const Series& series_;
  Phase phase_ = Phase::kNextEpisode;
  size_t episode_ = 0, jump_in_episode_ = 0, move_ = 0;
  const Target* target_ = nullptr;
  bool touching_ = false;        // robot-world contact at the last step
  bool still_touching_ = false;  // contact left over from the jump before: not counted until the arm has come free
  double held_since_ = -1, next_move_time_ = 0;
  std::vector<JumpRecord> records_;
};

// JSON array with one object for each record.
void write_records(std::FILE* file, const std::vector<JumpRecord>& records);

}  // namespace engram::sim

#endif  // ENGRAM_SIM_HARNESS_SIM_JUDGE_H_
