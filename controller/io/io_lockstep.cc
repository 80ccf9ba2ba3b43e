#include "controller/io/io_lockstep.h"

namespace engram::io {

void Tally::take(const engram_cycle& cycle) {
  ++cycles;
  ++rung[cycle.rung];
  cycle_us_sum += cycle.total_us;
  if (cycle.total_us > cycle_us_max) cycle_us_max = cycle.total_us;
}

void report_status(Report* report, engram_status status, int64_t utime, int64_t seq) {
  switch (status) {
    case ENGRAM_BAD_STATE:
      report->note(Trouble::kBadState, utime, seq);
      break;
    case ENGRAM_STALE_STATE:
      report->note(Trouble::kStaleState, utime, seq);
      break;
    case ENGRAM_BAD_TASK:
      report->note(Trouble::kBadTask, utime, seq);
      break;
    case ENGRAM_TASK_FAR:
      report->note(Trouble::kTaskFar, utime, seq);
      break;
    default:
      break;
  }
}

bool belongs_to_restart(const engram_msg_task_t& task, int64_t last, int64_t first) {
  return task.seq > 0 && first > last && task.utime >= first;
}

Lockstep::Lockstep(engram_controller* controller, Sender sender, Notes* notes, Report* report)
    : controller_(controller),
      about_(*engram_describe(engram_model_of(controller))),
      report_(report),
      notes_(notes),
      inbox_(about_, report),
      outbox_(about_, sender) {}

void Lockstep::on_state(const void* bytes, uint32_t size) {
  const int64_t last = state_.utime;
  switch (inbox_.state(bytes, size, &state_)) {
    case Verdict::kIgnored:
      return;
    case Verdict::kDuplicate:
      return sent(outbox_.command_again());
    case Verdict::kRestart:
      engram_reset(controller_);
      tick_ = 0;
      if (belongs_to_restart(task_, last, state_.utime)) give_task();
      break;
    case Verdict::kNew:
      break;
  }
  ++tally_.states;
  const bool tick = state_.utime >= tick_;
  if (tick) {
    engram_feedback(controller_, state_.utime, state_.q, state_.v);
    engram_cycle_info(controller_, &cycle_);
    tally_.take(cycle_);
    sent(outbox_.cycle(cycle_));
  }
  double tau[ENGRAM_NX_MAX];
  const engram_status status = engram_command(controller_, state_.utime, state_.q, state_.v, tau);
  report_status(report_, status, state_.utime, state_.seq);
  sent(outbox_.command(state_, status, tau));
  if (tick) {
    sent(outbox_.timing(cycle_));
    notes_->cycle(controller_, cycle_);
    tick_ = state_.utime + about_.tick_us;
    engram_prepare(controller_, tick_);
  }
}

void Lockstep::on_task(const void* bytes, uint32_t size) {
  if (inbox_.task(bytes, size, &task_) == Verdict::kNew) give_task();
}

void Lockstep::give_task() {
  const engram_status status = engram_set_task(controller_, task_.utime, task_.jump, task_.value, task_.n);
  report_status(report_, status, task_.utime, task_.seq);
}

}  // namespace engram::io
