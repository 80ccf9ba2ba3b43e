// Command line options of the harness programs: a table of name, help and destination.
#ifndef ENGRAM_SIM_HARNESS_SIM_OPTIONS_H_
#define ENGRAM_SIM_HARNESS_SIM_OPTIONS_H_

#include <cstdint>
#include <string>
#include <variant>
#include <vector>

namespace engram::sim {

struct Option {
  const char* name;   // "--scene"
  const char* value;  // what its value is called in the help, e.g. "FILE"
  const char* help;
  std::variant<std::string*, double*, int*, uint64_t*, std::vector<std::string>*> to;  // a vector takes the option repeatedly
};

// Fills the destinations. Prints help and exits with 0 for --help; prints one line and exits with 64 for a wrong option.
void parse_options(int argc, char** argv, const char* about, const std::vector<Option>& options);

}  // namespace engram::sim

#endif  // ENGRAM_SIM_HARNESS_SIM_OPTIONS_H_
