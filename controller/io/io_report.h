// What a controller tells its operator: one clear line per kind of trouble, counted, never a flood.
#ifndef CONTROLLER_IO_IO_REPORT_H_
#define CONTROLLER_IO_IO_REPORT_H_

#include <cstdint>
#include <cstdio>

namespace engram::io {

// kind, what happened and what the controller does about it, short name for the summary
#define ENGRAM_IO_TROUBLES(X)                                                                                             \
  X(kSize, "message of a wrong size (truncated?): ignored", "wrong size")                                                 \
  X(kForeign, "message with a foreign fingerprint (other type or other version of engram_msg): ignored", "foreign")       \
  X(kRobotDigest,                                                                                                         \
    "state of another robot (robot_digest differs: rebuild plant and controller from the same tables): "                  \
    "ignored, no command is sent",                                                                                        \
    "other robot")                                                                                                        \
  X(kTaskDigest,                                                                                                          \
    "task of another kind (task_digest differs: rebuild sender and controller from the same tables): "                    \
    "ignored, the last task stays",                                                                                       \
    "other task")                                                                                                         \
  X(kShape, "message with wrong nq, nv or n: ignored", "wrong shape")                                                     \
  X(kOutOfOrder, "message out of order: ignored", "out of order")                                                         \
  X(kDuplicate, "message received twice: a state is answered with the same command again", "duplicates")                  \
  X(kRestart, "the plant has restarted: task, plan and state forgotten", "plant restarts")                                \
  X(kBadState,                                                                                                            \
    "state not finite or beyond any physical range: the plan goes on without feedback, then gravity "                     \
    "compensation, then no torque",                                                                                       \
    "bad states")                                                                                                         \
  X(kStaleState, "no good state for too long: plan dropped", "stale states")                                              \
  X(kBadTask, "task refused (not finite, out of range or within an obstacle): the last task stays", "bad tasks")                                               \
  X(kTaskFar, "target outside the range the memory was built for: memory not asked, straight lines tried", "far targets") \
  X(kPublish, "a message could not be sent (network down?)", "unsent")                                                    \
  X(kFile, "a file could not be written (disk full?): writing stopped", "file errors")

enum class Trouble : int {
#define X(kind, text, brief) kind,
  ENGRAM_IO_TROUBLES(X)
#undef X
      kCount
};

// Counts troubles and prints the 1st, 10th, 100th ... of each kind. Not thread-safe: one per thread, added up at the end.
class Report {
 public:
  explicit Report(std::FILE* out = stderr) : out_(out) {}
  void note(Trouble kind, int64_t utime, int64_t seq);
  int64_t count(Trouble kind) const { return count_[static_cast<int>(kind)]; }
  void add(const Report& other);
  // "12 duplicates, 1 foreign", or "nothing ignored".
  void summarize(std::FILE* out) const;

 private:
  std::FILE* out_;
  int64_t count_[static_cast<int>(Trouble::kCount)] = {};
};

}  // namespace engram::io
#endif  // CONTROLLER_IO_IO_REPORT_H_
