#include "controller/io/io_report.h"

namespace engram::io {
namespace {

struct Line {
  const char* text;
  const char* brief;
};
constexpr Line kLines[] = {
#define X(kind, text, brief) {text, brief},
    ENGRAM_IO_TROUBLES(X)
#undef X
};

bool is_power_of_ten(int64_t n) {
  while (n % 10 == 0) n /= 10;
  return n == 1;
}

}  // namespace

void Report::note(Trouble kind, int64_t utime, int64_t seq) {
  const int64_t n = ++count_[static_cast<int>(kind)];
  if (out_ == nullptr || !is_power_of_ten(n)) return;
  std::fprintf(out_, "engram-controller: %s [utime %lld us, seq %lld, time no. %lld]\n", kLines[static_cast<int>(kind)].text,
               static_cast<long long>(utime), static_cast<long long>(seq), static_cast<long long>(n));
}

void Report::add(const Report& other) {
  for (int i = 0; i < static_cast<int>(Trouble::kCount); ++i) count_[i] += other.count_[i];
}

void Report::summarize(std::FILE* out) const {
  const char* separator = "";
  for (int i = 0; i < static_cast<int>(Trouble::kCount); ++i) {
    if (count_[i] == 0) continue;
    std::fprintf(out, "%s%lld %s", separator, static_cast<long long>(count_[i]), kLines[i].brief);
    separator = ", ";
  }
  if (*separator == '\0') std::fputs("no trouble", out);
}

}  // namespace engram::io
