// What both sides of a benchmark share: the stopwatch, the reader of input numbers, the JSON on standard output.
//
// Plain doubles only, so that the two executables (own build flags, never linked together) measure and report alike.
#ifndef BENCH_STOPWATCH_H_
#define BENCH_STOPWATCH_H_

#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <string>
#include <vector>

namespace bench {

// Processor time of this thread [us]: what other programs on the machine take does not count.
inline double thread_us() {
  timespec now;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return 1e6 * double(now.tv_sec) + 1e-3 * double(now.tv_nsec);
}

// Processor time of `n` calls of f after three warm-up calls, in microseconds, divided by `batch` (the pieces of work in one call).
template <class F> std::vector<double> sample_us(int n, F&& f, double batch = 1) {
  for (int i = 0; i < 3; ++i) f();
  std::vector<double> us(n);
  for (double& sample : us) {
    const double start = thread_us();
    f();
    sample = (thread_us() - start) / batch;
  }
  return us;
}

// Keeps a result alive without storing it.
template <class T> inline void keep(const T& value) { asm volatile("" : : "g"(&value) : "memory"); }

[[noreturn]] inline void fail(const std::string& what) {
  std::fprintf(stderr, "%s\n", what.c_str());
  std::exit(1);
}

// Whitespace-separated numbers of a text file; ends the program if there are none.
inline std::vector<double> read_numbers(const char* path) {
  std::ifstream file(path);
  std::vector<double> numbers;
  for (double number; file >> number;) numbers.push_back(number);
  if (numbers.empty()) fail(std::string(path) + ": no numbers");
  return numbers;
}

// One flat JSON object on standard output: name -> number or list of numbers, in order of the calls.
class Report {
 public:
  Report() { std::printf("{"); }
  ~Report() { std::printf("}\n"); }
  Report(const Report&) = delete;
  Report& operator=(const Report&) = delete;

  void number(const char* name, double value) {
    key(name);
    std::printf("%.17g", value);
  }
  void list(const char* name, const double* values, std::size_t n) {
    key(name);
    std::printf("[");
    for (std::size_t i = 0; i < n; ++i) std::printf(i ? ",%.17g" : "%.17g", values[i]);
    std::printf("]");
  }
  void list(const char* name, const std::vector<double>& values) { list(name, values.data(), values.size()); }

 private:
  void key(const char* name) {
    std::printf("%s\"%s\":", first_ ? "" : ",\n", name);
    first_ = false;
  }
  bool first_ = true;
};

}  // namespace bench
#endif  // BENCH_STOPWATCH_H_
