// Runs a task series and judges it: which target holds now, and how each jump ended.
#ifndef ENGRAM_SIM_HARNESS_SIM_JUDGE_H_
#define ENGRAM_SIM_HARNESS_SIM_JUDGE_H_

#include <cstdio>
#include <string>
#include <vector>

#include "sim_harness/sim_model.h"
#include "sim_harness/sim_series.h"

namespace engram::sim {

// A velocity limit is a barrier of the optimal control problem, not a clamp: the fast feedback may brush it.
constexpr double kSpeedTolerance = 0.02;  // 1, of the limit

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

class Judge : public Script {
 public:
  explicit Judge(const Series& series) : series_(series) {}

  Event begin_step(double t) override;

  // Judges the state of time t. Needs its positions and contacts (mj_step1). Returns the record of a jump that ended now, or
  // nullptr.
  const JumpRecord* judge(const Model& model, double t);
  std::string look(const Model& model, double t) override;
  void command(double torque_share, int status) override;

  bool finished() const override { return phase_ == Phase::kFinished; }
  void write(std::FILE* file) const override;
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

}  // namespace engram::sim

#endif  // ENGRAM_SIM_HARNESS_SIM_JUDGE_H_
