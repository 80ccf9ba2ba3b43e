// The whole-body problems of the bench, compiled apart.
#ifndef BENCH_WHOLE_BODY_BENCH_H_
#define BENCH_WHOLE_BODY_BENCH_H_

#include <string>

namespace engram::bench {

bool is_whole_body(const std::string& problem);
// command: compare or time; argument: trajectory file or number of samples.
void run_whole_body(const std::string& command, const std::string& problem, const char* argument);

}  // namespace engram::bench
#endif  // BENCH_WHOLE_BODY_BENCH_H_
