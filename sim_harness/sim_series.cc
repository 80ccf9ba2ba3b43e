#include "sim_harness/sim_series.h"

#include <cmath>
#include <fstream>

#include "sim_harness/sim_lines.h"

namespace engram::sim {
namespace {

std::string take_target(const std::vector<double>& numbers, size_t at, Target* target) {
  if (numbers.size() < at + 8) return "a target needs a position, a quaternion x y z w and a task vector";
  if (numbers.size() > at + 7 + kMaxTask) return "a task vector has at most 32 numbers";
  double norm = 0;
  for (int i = 0; i < 3; ++i) target->pose.p[i] = numbers[at + i];
  for (int i = 0; i < 4; ++i) {
    target->pose.quat[i] = numbers[at + 3 + i];
    norm += target->pose.quat[i] * target->pose.quat[i];
  }
  if (std::fabs(norm - 1.0) > 1e-6) return "the quaternion of a target must have length 1";
  target->value.assign(numbers.begin() + at + 7, numbers.end());
  return "";
}

}  // namespace

int Series::jump_count() const {
  int count = 0;
  for (const Episode& episode : episodes) count += static_cast<int>(episode.jumps.size());
  return count;
}

std::string Series::read(const char* path, int nq, int nv) {
  std::ifstream file(path);
  if (!file) return std::string("cannot read the series '") + path + "'; `engram demo` writes one from a seed";
  std::string text, key;
  int number = 0;
  const auto fault = [&](const std::string& what) { return fault_at(path, number, what); };

  if (!std::getline(file, text) || text != "engram_series 1") {
    return std::string(path) + ":1: a series starts with `engram_series 1`; write it again with `engram demo`";
  }
  for (number = 2; std::getline(file, text); ++number) {
    std::istringstream line(text);
    if (!(line >> key) || key[0] == '#') continue;
    if (key == "robot_digest" || key == "task_digest" || key == "hand") {
      std::string word;
      if (!(line >> word)) return fault("`" + key + "` needs a value");
      if (key == "hand") hand = word;
      else (key == "robot_digest" ? robot_digest : task_digest) = std::strtoull(word.c_str(), nullptr, 0);
      continue;
    }
    std::vector<double> numbers;
    if (!read_numbers(line, &numbers)) return fault("not a finite number");
    if (key == "window" || key == "hold") {
      if (numbers.size() != 1 || numbers[0] <= 0) return fault("`" + key + "` needs one positive number of seconds");
      (key == "window" ? window : hold) = numbers[0];
    } else if (key == "tolerance") {
      if (numbers.size() != 2 || numbers[0] <= 0 || numbers[1] <= 0) return fault("`tolerance` needs metres and radians");
      position_tolerance = numbers[0], rotation_tolerance = numbers[1];
    } else if (key == "speed") {
      if (static_cast<int>(numbers.size()) != nv) return fault("`speed` needs nv = " + std::to_string(nv) + " numbers");
      speed = numbers;
    } else if (key == "episode") {
      if (static_cast<int>(numbers.size()) != nq) return fault("`episode` needs nq = " + std::to_string(nq) + " numbers");
      episodes.push_back({numbers, {}});
    } else if (key == "jump" || key == "move") {
      if (episodes.empty()) return fault("`" + key + "` before the first `episode`");
      std::vector<Jump>& jumps = episodes.back().jumps;
      if (key == "move" && jumps.empty()) return fault("`move` before the first `jump` of its episode");
      Target target;
      const std::string wrong = take_target(numbers, key == "move" ? 1 : 0, &target);
      if (!wrong.empty()) return fault(wrong);
      if (key == "jump") {
        jumps.push_back({target, {}});
      } else {
        target.dt = numbers[0];
        if (target.dt < 1e-3) return fault("`move` needs a time step of at least 0.001 s");
        jumps.back().moves.push_back(target);
      }
    } else {
      return fault("unknown key `" + key + "`");
    }
  }
  return jump_count() > 0 ? "" : std::string(path) + ": the series holds no jump";
}

}  // namespace engram::sim
