// The gate-keeper: which messages reach the controller. Everything else is counted, reported once, and ignored.
#ifndef CONTROLLER_IO_IO_INBOX_H_
#define CONTROLLER_IO_IO_INBOX_H_

#include "controller/engram.h"
#include "controller/io/io_message.h"
#include "controller/io/io_report.h"

namespace engram::io {

enum class Verdict {
  kNew,        // act on it
  kDuplicate,  // the last good one again
  kRestart,    // the first of a plant that has restarted: forget everything, then act on it
  kIgnored,
};

class Inbox {
 public:
  Inbox(const engram_description& about, Report* report) : about_(about), report_(report) {}

  // `*state` is the message if kNew or kRestart, else unchanged.
  Verdict state(const void* bytes, uint32_t size, engram_msg_state_t* state);
  // Never kRestart: a plant that restarts sends its first state before its first task.
  Verdict task(const void* bytes, uint32_t size, engram_msg_task_t* task);

 private:
  bool good(Decoded decoded);

  const engram_description& about_;
  Report* report_;
  int64_t state_seq_ = 0, state_utime_ = 0, task_seq_ = 0;  // of the last good messages; 0: none
};

}  // namespace engram::io
#endif  // CONTROLLER_IO_IO_INBOX_H_
