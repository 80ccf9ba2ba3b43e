#include "sim_harness/sim_options.h"

#include <cstdio>
#include <cstdlib>
#include <cstring>

namespace engram::sim {
namespace {

bool assign(const Option& option, const char* text) {
  char* end = nullptr;
  if (auto to = std::get_if<std::string*>(&option.to)) **to = text;
  else if (auto to = std::get_if<std::vector<std::string>*>(&option.to)) (*to)->push_back(text);
  else if (auto to = std::get_if<double*>(&option.to)) **to = std::strtod(text, &end);
  else if (auto to = std::get_if<int*>(&option.to)) **to = static_cast<int>(std::strtol(text, &end, 10));
  else if (auto to = std::get_if<uint64_t*>(&option.to)) **to = std::strtoull(text, &end, 0);
  return !end || (end != text && !*end);
}

}  // namespace

void parse_options(int argc, char** argv, const char* about, const std::vector<Option>& options) {
  for (int i = 1; i < argc; ++i) {
    if (!std::strcmp(argv[i], "--help") || !std::strcmp(argv[i], "-h")) {
      std::printf("%s\n\n", about);
      for (const Option& option : options) {
        const std::string left = std::string(option.name) + " " + option.value;
        std::printf("  %-28s %s\n", left.c_str(), option.help);
      }
      std::exit(0);
    }
    const Option* found = nullptr;
    for (const Option& option : options) {
      if (!std::strcmp(argv[i], option.name)) found = &option;
    }
    const char* wrong = nullptr;
    if (!found) wrong = "unknown option";
    else if (i + 1 == argc) wrong = "a value is missing after";
    else if (!assign(*found, argv[++i])) wrong = "not a number for the option before";
    if (wrong) {
      std::fprintf(stderr, "%s: %s '%s'; see --help\n", argv[0], wrong, argv[i]);
      std::exit(64);  // EX_USAGE
    }
  }
}

}  // namespace engram::sim
