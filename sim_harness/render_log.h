// What the renderer needs of an LCM log: postures, targets and plans of some time ranges.
#ifndef ENGRAM_SIM_HARNESS_RENDER_LOG_H_
#define ENGRAM_SIM_HARNESS_RENDER_LOG_H_

#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace engram::sim {

struct TimeRange {
  double begin, end;  // s, plant clock
};

struct RunLog {
  std::map<int64_t, std::vector<double>> q;                    // us -> state_t.q
  std::map<int64_t, std::vector<double>> task;                 // us -> task_t.value
  std::map<int64_t, std::vector<std::array<double, 3>>> path;  // us -> cycle_t.path (m)
  double end = 0;                                              // s, of the whole log

  // Reads what lies within 0.1 s of one of the ranges; every task (an earlier one may still hold). Without ranges, everything.
  // Returns an empty string, or one line that says what is wrong.
  std::string read(const char* path, const std::vector<TimeRange>& ranges);
};

// The entry of the latest time up to `utime`, or nullptr.
template <class T> const T* latest(const std::map<int64_t, T>& series, int64_t utime) {
  auto after = series.upper_bound(utime);
  return after == series.begin() ? nullptr : &std::prev(after)->second;
}

}  // namespace engram::sim

#endif  // ENGRAM_SIM_HARNESS_RENDER_LOG_H_
