// Figures that a test measures, for build/figures/<command>.json (docs/figures.md).
#ifndef TESTS_SUPPORT_FIGURES_H_
#define TESTS_SUPPORT_FIGURES_H_

#include <cstdio>
#include <filesystem>
#include <string>

namespace engram::test {

// Prints one figure and writes it as the only one of build/figures/<command>.json under the working directory.
inline void write_figure(const std::string& command, const char* id, long long value, const char* unit, long long n) {
  std::printf("%s = %lld %s (n = %lld)\n", id, value, unit, n);
  std::filesystem::create_directories("build/figures");
  std::FILE* file = std::fopen(("build/figures/" + command + ".json").c_str(), "w");
  if (file == nullptr) return;
  std::fprintf(file, "[\n  {\"id\": \"%s\", \"value\": %lld, \"unit\": \"%s\", \"n\": %lld}\n]\n", id, value, unit, n);
  std::fclose(file);
}

}  // namespace engram::test
#endif  // TESTS_SUPPORT_FIGURES_H_
