#include "sim_harness/sim_judge.h"

#include <algorithm>
#include <cmath>

namespace engram::sim {

constexpr double kHalfStep = 5e-4;  // s; compares times that are multiples of the plant step

std::string JumpRecord::reason() const {
  std::string text;
  const auto add = [&](bool failed, const char* word) {
    if (failed) text += (text.empty() ? "" : "+") + std::string(word);
  };
  add(late(), "late");
  add(contact_time >= 0, "contact");
  add(limit(), "limit");
  return text.empty() ? "ok" : text;
}

void Judge::advance() {
  move_ = 0;
  if (++jump_in_episode_ < series_.episodes[episode_].jumps.size()) {
    phase_ = Phase::kNextJump;
    return;
  }
  jump_in_episode_ = 0;
  do {
    ++episode_;
  } while (episode_ < series_.episodes.size() && series_.episodes[episode_].jumps.empty());
  phase_ = episode_ < series_.episodes.size() ? Phase::kNextEpisode : Phase::kFinished;
}

Script::Event Judge::begin_step(double t) {
  Event event;
  if (phase_ == Phase::kNextEpisode) {
    event.reset = &series_.episodes[episode_].q;
    touching_ = false;
    phase_ = Phase::kNextJump;
  } else if (phase_ == Phase::kNextJump) {
    JumpRecord record;
    record.episode = static_cast<int>(episode_) + 1;
    record.jump = static_cast<int>(records_.size()) + 1;
    record.t_start = t;
    records_.push_back(record);
    target_ = &jump().target;
    event.task = &target_->value;
    held_since_ = -1;
    still_touching_ = touching_;
    phase_ = Phase::kJump;
  } else if (phase_ == Phase::kMove && t > next_move_time_ - kHalfStep) {
    if (move_ == jump().moves.size()) {
      advance();
      return begin_step(t);
    }
    target_ = &jump().moves[move_++];
    event.task = &target_->value;
    next_move_time_ += move_ < jump().moves.size() ? jump().moves[move_].dt : target_->dt;
  }
  event.jump = static_cast<int>(records_.size());
  return event;
}

const JumpRecord* Judge::judge(const Model& model, double t) {
  if (phase_ != Phase::kJump && phase_ != Phase::kMove) return nullptr;
  JumpRecord& record = records_.back();
  const Pose hand = model.hand_pose();
  const double position = position_error(hand, target_->pose), rotation = rotation_error(hand, target_->pose);
  const int contact = model.robot_world_contact();
  touching_ = contact >= 0;

  if (phase_ == Phase::kMove) {
    ++record.move_steps;
    record.move_error_sum += position;
    record.move_error_max = std::max(record.move_error_max, position);
    record.move_contact |= contact >= 0;
    return nullptr;
  }

  const double since = t - record.t_start;
  record.position_error = position;
  record.rotation_error = rotation;
  record.joint_excess = std::max(record.joint_excess, model.joint_excess());
  for (size_t i = 0; i < series_.speed.size(); ++i) {
    record.speed_share = std::max(record.speed_share, std::fabs(model.d->qvel[i]) / series_.speed[i]);
  }
  if (contact < 0) still_touching_ = false;
  if (contact >= 0 && !still_touching_ && record.contact_time < 0) {
    record.contact_time = since;
    record.contact = std::string(model.geom_label(model.d->contact[contact].geom1)) + " - " +
                     model.geom_label(model.d->contact[contact].geom2);
  }
  const bool inside = position <= series_.position_tolerance && rotation <= series_.rotation_tolerance;
  if (!inside) held_since_ = -1;
  else if (held_since_ < 0 && since < series_.window + kHalfStep) held_since_ = since;

  const bool held = held_since_ >= 0 && since - held_since_ > series_.hold - kHalfStep;
  const bool over = held_since_ < 0 && since > series_.window - kHalfStep;  // a hold that began in time may end after the window
  if (!held && !over) return nullptr;
  if (held) record.arrival = held_since_;
  record.t_end = t;
  if (jump().moves.empty()) {
    advance();
  } else {
    phase_ = Phase::kMove;
    next_move_time_ = t + jump().moves[0].dt;
  }
  return &record;
}

std::string Judge::look(const Model& model, double t) {
  const JumpRecord* r = judge(model, t);
  if (!r) return "";
  char line[128];
  std::snprintf(line, sizeof line, "jump %d/%d %s %.2f s", r->jump, series_.jump_count(), r->reason().c_str(), r->t_end - r->t_start);
  return line;
}

void Judge::command(double torque_share, int status) {
  if (phase_ != Phase::kJump) return;
  JumpRecord& record = records_.back();
  record.torque_share = std::max(record.torque_share, torque_share);
  ++record.statuses[status >= 0 && status < kMaxStatus ? status : kMaxStatus - 1];
}

void write_statuses(std::FILE* file, const int (&statuses)[kMaxStatus]) {
  std::fprintf(file, "{");
  const char* comma = "";
  for (int status = 0; status < kMaxStatus; ++status) {
    if (statuses[status] == 0) continue;
    std::fprintf(file, "%s\"%d\": %d", comma, status, statuses[status]);
    comma = ", ";
  }
  std::fprintf(file, "}");
}

void Judge::write(std::FILE* file) const {
  std::fprintf(file, "\"jumps\": [");
  const char* separator = "\n";
  for (const JumpRecord& r : records_) {
    std::fprintf(
        file,
        "%s    {\"episode\": %d, \"jump\": %d, \"t_start_s\": %.3f, \"t_end_s\": %.3f, \"success\": %s, \"reason\": \"%s\", "
        "\"arrival_s\": %.3f, \"contact_time_s\": %.3f, \"contact\": \"%s\", \"joint_excess\": %.6f, \"speed_share\": %.4f, "
        "\"torque_share\": %.4f, \"position_error_m\": %.5f, \"rotation_error_rad\": %.5f, \"statuses\": ",
        separator, r.episode, r.jump, r.t_start, r.t_end, r.success() ? "true" : "false", r.reason().c_str(), r.arrival,
        r.contact_time, r.contact.c_str(), r.joint_excess, r.speed_share, r.torque_share, r.position_error, r.rotation_error);
    write_statuses(file, r.statuses);
    if (r.move_steps > 0) {
      std::fprintf(file, ", \"move\": {\"duration_steps\": %d, \"mean_error_m\": %.5f, \"max_error_m\": %.5f, \"contact\": %s}",
                   r.move_steps, r.move_error_sum / r.move_steps, r.move_error_max, r.move_contact ? "true" : "false");
    }
    std::fprintf(file, "}");
    separator = ",\n";
  }
  std::fprintf(file, "%s]", records_.empty() ? "" : "\n  ");
}

}  // namespace engram::sim
