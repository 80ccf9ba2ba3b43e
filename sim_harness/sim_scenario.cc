#include "sim_harness/sim_scenario.h"

#include <algorithm>
#include <cmath>
#include <fstream>

#include "sim_harness/sim_lines.h"

namespace engram::sim {
namespace {

constexpr double kHalfStep = 5e-4;  // s; compares times that are multiples of the plant step

// Numbers that a line of each key must have; 0: as many as the model or task asks for.
int numbers_of(const std::string& key) {
  if (key == "upright" || key == "drift") return 2;
  if (key == "height" || key == "pace") return 5;
  return 0;
}

std::string take_push(bool smooth, const std::string& body, const std::vector<double>& numbers, const Model& model, Trial* trial) {
  Push push;
  push.body = mj_name2id(model.m, mjOBJ_BODY, body.c_str());
  if (push.body < 1) return "the scene has no body '" + body + "'";
  push.t = numbers[0], push.duration = numbers[1], push.smooth = smooth;
  std::copy_n(numbers.begin() + 2, 3, push.force);
  if (numbers.size() == 8) std::copy_n(numbers.begin() + 5, 3, push.torque);
  if (push.t < 0 || push.duration <= 0) return "a push needs a time from 0 on and a positive duration";
  trial->pushes.push_back(push);
  return "";
}

std::string take_reach(std::istringstream& line, const Model& model, Trial* trial) {
  std::string t, bound, site;
  line >> t >> bound >> site;
  std::istringstream first(t + " " + bound);
  std::vector<double> numbers;
  if (!read_numbers(first, &numbers) || !read_numbers(line, &numbers) || numbers.size() != 5) return "the form is `reach t m site x y z`";
  Reach reach;
  reach.site = mj_name2id(model.m, mjOBJ_SITE, site.c_str());
  if (reach.site < 0) return "the scene has no site '" + site + "'";
  if (numbers[0] < 0 || numbers[0] >= trial->duration || numbers[1] <= 0) return "`reach` needs a time within the episode and a positive bound";
  if (!trial->reach.empty() && numbers[0] <= trial->reach.back().t) return "`reach` must come in the order of times";
  reach.t = numbers[0], reach.bound = numbers[1];
  std::copy(numbers.begin() + 2, numbers.end(), reach.want);
  trial->reach.push_back(reach);
  return "";
}

// A point is to be kept until the next task sets in.
void end_reaches(Trial* trial) {
  for (Reach& reach : trial->reach) {
    reach.end = trial->duration;
    for (const TimedTask& task : trial->tasks)
      if (task.t > reach.t) reach.end = std::min(reach.end, task.t);
  }
}

std::string take_line(const std::string& key, std::istringstream& line, const Model& model, Trial* trial) {
  std::vector<double> numbers;
  if (key == "push" || key == "gust") {
    std::string t, duration, body;
    line >> t >> duration >> body;
    std::istringstream times(t + " " + duration);
    if (!read_numbers(times, &numbers) || !read_numbers(line, &numbers) || (numbers.size() != 5 && numbers.size() != 8))
      return "the form is `" + key + " t d body fx fy fz [tx ty tz]`";
    return take_push(key == "gust", body, numbers, model, trial);
  }
  if (key == "reach") return take_reach(line, model, trial);
  if (key == "clear") {
    std::string geom;
    line >> geom;
    trial->clear = mj_name2id(model.m, mjOBJ_GEOM, geom.c_str());
    return trial->clear < 0 ? "the scene has no geom '" + geom + "'" : "";
  }
  if (!read_numbers(line, &numbers)) return "not a finite number";
  const int n = static_cast<int>(numbers.size()), wanted = numbers_of(key);
  if (wanted > 0 && n != wanted) return "`" + key + "` needs " + std::to_string(wanted) + " numbers";
  if (key == "state") {
    if (n != model.nq) return "`state` needs nq = " + std::to_string(model.nq) + " numbers";
    trial->q = numbers;
  } else if (key == "task") {
    if (n < 2 || n > kMaxTask + 1) return "`task` needs a time and a task vector of at most 32 numbers";
    if (!trial->tasks.empty() && numbers[0] <= trial->tasks.back().t) return "tasks must come in the order of their times";
    trial->tasks.push_back({numbers[0], {numbers.begin() + 1, numbers.end()}});
  } else if (key == "upright") {
    trial->lowest = numbers[0], trial->tilt = numbers[1];
  } else {
    Demand* demand = key == "drift" ? &trial->drift : key == "height" ? &trial->height : key == "pace" ? &trial->pace : nullptr;
    if (!demand) return "unknown key `" + key + "`";
    if (numbers[0] < 0 || numbers[0] >= trial->duration || numbers[1] <= 0)
      return "`" + key + "` needs a time within the episode and a positive bound";
    demand->t = numbers[0], demand->bound = numbers[1];
    std::copy(numbers.begin() + 2, numbers.end(), demand->want);
  }
  return "";
}

}  // namespace

std::string Scenario::read(const char* path, const Model& model) {
  std::ifstream file(path);
  if (!file) return std::string("cannot read the scenario '") + path + "'; `engram demo` writes one from a seed";
  std::string text, key;
  if (!std::getline(file, text) || text != "engram_scenario 1") {
    return fault_at(path, 1, "a scenario starts with `engram_scenario 1`; write it again with `engram demo`");
  }
  int number = 1;
  const auto complete = [&]() -> std::string {
    if (trials.empty()) return "";
    if (trials.back().q.empty()) return fault_at(path, number, "episode `" + trials.back().name + "` has no `state`");
    if (trials.back().tasks.empty()) return fault_at(path, number, "episode `" + trials.back().name + "` has no `task`");
    end_reaches(&trials.back());
    return "";
  };
  while (std::getline(file, text)) {
    ++number;
    std::istringstream line(text);
    if (!(line >> key) || key[0] == '#') continue;
    std::string wrong;
    if (key == "robot_digest" || key == "task_digest") {
      std::string word;
      if (!(line >> word)) return fault_at(path, number, "`" + key + "` needs a value");
      (key == "robot_digest" ? robot_digest : task_digest) = std::strtoull(word.c_str(), nullptr, 0);
    } else if (key == "episode") {
      wrong = complete();
      if (!wrong.empty()) return wrong;
      Trial trial;
      std::vector<double> numbers;
      line >> trial.name;
      if (!read_numbers(line, &numbers) || numbers.size() != 1 || numbers[0] <= 0)
        return fault_at(path, number, "the form is `episode name seconds`");
      trial.duration = numbers[0];
      trials.push_back(trial);
    } else if (trials.empty()) {
      return fault_at(path, number, "`" + key + "` before the first `episode`");
    } else if (wrong = take_line(key, line, model, &trials.back()); !wrong.empty()) {
      return fault_at(path, number, wrong);
    }
  }
  if (trials.empty()) return std::string(path) + ": the scenario holds no episode";
  return complete();
}

double TrialRecord::height_rms() const { return height_steps > 0 ? std::sqrt(height_sum / static_cast<double>(height_steps)) : 0; }

int TrialRecord::reached(const Trial& trial) const {
  int count = 0;
  for (size_t i = 0; i < reach.size(); ++i) count += t_end - t_start > trial.reach[i].end - 2 * kHalfStep && reach[i] <= trial.reach[i].bound;
  return count;
}

std::string Referee::reason(const Trial& trial, const TrialRecord& r) {
  std::string text;
  const auto add = [&](bool failed, const char* word) {
    if (failed) text += (text.empty() ? "" : "+") + std::string(word);
  };
  const auto off_pace = [&] {
    for (int i = 0; i < 3; ++i)
      if (!(std::fabs(r.pace[i] - trial.pace.want[i]) <= trial.pace.bound)) return true;
    return false;
  };
  add(r.fallen, "fall");
  add(trial.drift.asked() && !(r.drift <= trial.drift.bound), "drift");
  add(trial.height.asked() && !(r.height_rms() <= trial.height.bound), "height");
  add(trial.pace.asked() && !r.fallen && off_pace(), "pace");
  add(!r.fallen && r.reached(trial) < static_cast<int>(trial.reach.size()), "reach");
  add(r.touched, "touch");
  add(r.torque_share > 1 + kTorqueTolerance || r.joint_excess > kJointTolerance, "limit");
  return text.empty() ? "ok" : text;
}

Script::Event Referee::begin_step(double t) {
  Event event;
  event.jump = jump_;
  const Trial& trial = scenario_.trials[trial_];
  if (!running_) {
    running_ = true;
    task_ = 0;
    records_.emplace_back();
    records_.back().t_start = t;
    records_.back().reach.assign(trial.reach.size(), 0.0);
    event.reset = &trial.q;
    event.pushes = &trial.pushes;
    return event;
  }
  const double since = t - records_.back().t_start;
  if (task_ < trial.tasks.size() && since > trial.tasks[task_].t - kHalfStep) {
    event.task = &trial.tasks[task_++].value;
    event.jump = ++jump_;
    last_task_ = since;
  }
  return event;
}

void Referee::measure(const Trial& trial, const Model& model, double since, TrialRecord* r) {
  const double *com = model.com(), *p = model.base_position();
  const double yaw = model.heading();
  const bool first = since < kHalfStep;
  if (first) {
    first_height_ = com[2];
    first_yaw_ = yaw_ = yaw;
  }
  yaw_ += std::remainder(yaw - yaw_, 2 * M_PI);
  r->lowest = std::min(r->lowest, p[2]);
  r->tilt = std::max(r->tilt, model.tilt());
  r->fallen = !(p[2] >= trial.lowest && model.tilt() <= trial.tilt);
  r->joint_excess = std::max(r->joint_excess, model.joint_excess());
  const auto begins = [&](const Demand& d) { return std::fabs(since - d.t) < kHalfStep; };
  const auto holds = [&](const Demand& d) { return d.asked() && since > d.t - kHalfStep; };
  if (begins(trial.drift)) std::copy(com, com + 3, anchor_);
  if (holds(trial.drift))
    r->drift = std::max(r->drift, std::sqrt((com[0] - anchor_[0]) * (com[0] - anchor_[0]) + (com[1] - anchor_[1]) * (com[1] - anchor_[1]) +
                                            (com[2] - anchor_[2]) * (com[2] - anchor_[2])));
  if (holds(trial.height)) {
    const double* w = trial.height.want;
    const double wanted = first_height_ + w[0] - 0.5 * w[1] * (1 - std::cos(2 * M_PI * w[2] * (since - last_task_)));
    r->height_sum += (com[2] - wanted) * (com[2] - wanted);
    ++r->height_steps;
  }
  for (size_t i = 0; i < trial.reach.size(); ++i) {
    const Reach& reach = trial.reach[i];
    if (since < reach.t - kHalfStep || since > reach.end - kHalfStep) continue;
    const mjtNum* const at = model.d->site_xpos + 3 * reach.site;
    const double* const w = reach.want;
    const double far = std::sqrt((at[0] - w[0]) * (at[0] - w[0]) + (at[1] - w[1]) * (at[1] - w[1]) + (at[2] - w[2]) * (at[2] - w[2]));
    r->reach[i] = std::max(r->reach[i], far);
  }
  for (int i = 0; trial.clear >= 0 && i < model.d->ncon; ++i) {
    const mjContact& c = model.d->contact[i];
    r->touched = r->touched || ((c.geom1 == trial.clear || c.geom2 == trial.clear) && c.dist <= 0);
  }
  if (begins(trial.pace)) {
    from_[0] = p[0], from_[1] = p[1];
    from_yaw_ = yaw_;
  }
  if (holds(trial.pace) && since - trial.pace.t > kHalfStep) {
    const double dt = since - trial.pace.t, dx = p[0] - from_[0], dy = p[1] - from_[1];
    const double c = std::cos(first_yaw_), s = std::sin(first_yaw_);
    r->pace[0] = (c * dx + s * dy) / dt;
    r->pace[1] = (-s * dx + c * dy) / dt;
    r->pace[2] = (yaw_ - from_yaw_) / dt;
  }
}

std::string Referee::look(const Model& model, double t) {
  const Trial& trial = scenario_.trials[trial_];
  TrialRecord& r = records_.back();
  const double since = t - r.t_start;
  measure(trial, model, since, &r);
  if (!r.fallen && since < trial.duration - kHalfStep) return "";
  r.t_end = t;
  running_ = false;
  ++trial_;
  char line[256];
  std::snprintf(line, sizeof line, "episode %zu/%zu %s %.2f s %s", trial_, scenario_.trials.size(), reason(trial, r).c_str(), since,
                trial.name.c_str());
  return line;
}

void Referee::command(double torque_share, int status) {
  if (!running_) return;
  TrialRecord& r = records_.back();
  r.torque_share = std::max(r.torque_share, torque_share);
  ++r.statuses[status >= 0 && status < kMaxStatus ? status : kMaxStatus - 1];
}

void Referee::write(std::FILE* file) const {
  std::fprintf(file, "\"episodes\": [");
  const char* separator = "\n";
  for (size_t i = 0; i < records_.size(); ++i) {
    const Trial& trial = scenario_.trials[i];
    const TrialRecord& r = records_[i];
    const std::string why = reason(trial, r);
    std::fprintf(file,
                 "%s    {\"episode\": %zu, \"name\": \"%s\", \"t_start_s\": %.3f, \"t_end_s\": %.3f, \"success\": %s, \"reason\": \"%s\", "
                 "\"base_height_min_m\": %.4f, \"tilt_max_rad\": %.4f, \"joint_excess\": %.6f, \"torque_share\": %.4f",
                 separator, i + 1, trial.name.c_str(), r.t_start, r.t_end, why == "ok" ? "true" : "false", why.c_str(), r.lowest, r.tilt,
                 r.joint_excess, r.torque_share);
    if (trial.drift.asked()) std::fprintf(file, ", \"com_drift_m\": %.6f", r.drift);
    if (trial.height.asked()) std::fprintf(file, ", \"com_height_rms_m\": %.6f", r.height_rms());
    if (trial.pace.asked()) std::fprintf(file, ", \"pace\": [%.4f, %.4f, %.4f]", r.pace[0], r.pace[1], r.pace[2]);
    if (!trial.reach.empty())
      std::fprintf(file, ", \"reach_error_m\": %.4f, \"reached\": %d, \"to_reach\": %zu", *std::max_element(r.reach.begin(), r.reach.end()),
                   r.reached(trial), trial.reach.size());
    if (trial.clear >= 0) std::fprintf(file, ", \"touched\": %s", r.touched ? "true" : "false");
    std::fprintf(file, ", \"statuses\": ");
    write_statuses(file, r.statuses);
    std::fprintf(file, "}");
    separator = ",\n";
  }
  std::fprintf(file, "%s]", records_.empty() ? "" : "\n  ");
}

}  // namespace engram::sim
