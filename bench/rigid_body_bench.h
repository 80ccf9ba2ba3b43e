// Rigid-body algorithms of a robot: numbers for the equality gate, and times.
#ifndef BENCH_RIGID_BODY_BENCH_H_
#define BENCH_RIGID_BODY_BENCH_H_

#include <string>

namespace engram::bench {

bool is_robot(const std::string& name);
// command: compare or time; passes over the samples in the file, if time.
void run_rigid_body(const std::string& command, const std::string& robot, const char* file, int passes);

}  // namespace engram::bench
#endif  // BENCH_RIGID_BODY_BENCH_H_
