// Reading line-based input files of the harness: words and numbers, and faults that name file and line.
#ifndef ENGRAM_SIM_HARNESS_SIM_LINES_H_
#define ENGRAM_SIM_HARNESS_SIM_LINES_H_

#include <cmath>
#include <cstdlib>
#include <sstream>
#include <string>
#include <vector>

namespace engram::sim {

// All the numbers left on a line; false if one of them is not a finite number.
inline bool read_numbers(std::istringstream& line, std::vector<double>* out) {
  std::string word;
  while (line >> word) {
    char* end = nullptr;
    const double number = std::strtod(word.c_str(), &end);
    if (*end || !std::isfinite(number)) return false;
    out->push_back(number);
  }
  return true;
}

// file:line: what is wrong
inline std::string fault_at(const char* path, int line, const std::string& what) {
  return std::string(path) + ":" + std::to_string(line) + ": " + what;
}

}  // namespace engram::sim

#endif  // ENGRAM_SIM_HARNESS_SIM_LINES_H_
