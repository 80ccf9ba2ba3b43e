// Lock step: the plant waits for each command. One thread, counted iterations: the same messages in, the same messages out.
#ifndef CONTROLLER_IO_IO_LOCKSTEP_H_
#define CONTROLLER_IO_IO_LOCKSTEP_H_

#include "controller/engram.h"
#include "controller/io/io_inbox.h"
#include "controller/io/io_notes.h"
#include "controller/io/io_outbox.h"

namespace engram::io {

// Counts of one run, for the summary.
struct Tally {
  int64_t states = 0, cycles = 0, jumps = 0;
  int64_t rung[ENGRAM_RUNG_COUNT] = {};
  double cycle_us_sum = 0, cycle_us_max = 0;
  void take(const engram_cycle& cycle);
};

class Lockstep {
 public:
  Lockstep(engram_controller* controller, Sender sender, Notes* notes, Report* report);

  // One message of ENGRAM_STATE: feedback at a tick, then the command, then the plan for the next tick.
  void on_state(const void* bytes, uint32_t size);
  // One message of ENGRAM_TASK.
  void on_task(const void* bytes, uint32_t size);

  const Tally& tally() const { return tally_; }

 private:
  void give_task();
  void sent(bool ok) {
    if (!ok) report_->note(Trouble::kPublish, state_.utime, state_.seq);
  }

  engram_controller* controller_;
  const engram_description& about_;
  Report* report_;
  Notes* notes_;
  Inbox inbox_;
  Outbox outbox_;
  Tally tally_;
  int64_t tick_ = 0;  // us, time of the next feedback; 0: at the next state
  engram_msg_task_t task_ = {};
  engram_msg_state_t state_ = {};
  engram_cycle cycle_ = {};
};

// A plant that only sets its robot back keeps its clock, and may send the next task just before its first state: that task stays.
bool belongs_to_restart(const engram_msg_task_t& task, int64_t last, int64_t first);

// Notes a status that an operator should hear of.
void report_status(Report* report, engram_status status, int64_t utime, int64_t seq);

}  // namespace engram::io
#endif  // CONTROLLER_IO_IO_LOCKSTEP_H_
