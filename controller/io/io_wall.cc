#include "controller/io/io_wall.h"

#include <cerrno>

#include "controller/io/io_realtime.h"

namespace engram::io {
namespace {
constexpr int kCommandPriority = 60, kPlannerPriority = 50;
}

Wall::Wall(engram_controller* controller, Sender commands, Sender cycles, Notes* notes, Report* report, bool realtime)
    : controller_(controller),
      about_(*engram_describe(engram_model_of(controller))),
      report_(report),
      notes_(notes),
      realtime_(realtime),
      inbox_(about_, report),
      commands_(about_, commands),
      cycles_(about_, cycles) {
  sem_init(&wake_, 0, 0);
  thread_ = std::thread([this] { plan(); });
  if (realtime_) go_realtime(kCommandPriority);
}

Wall::~Wall() {
  stop();
  sem_destroy(&wake_);
}

void Wall::stop() {
  if (!thread_.joinable()) return;
  stopping_ = true;
  wake();
  thread_.join();
  report_->add(planner_report_);
}

void Wall::on_state(const void* bytes, uint32_t size) {
  const int64_t last = state_.utime;
  switch (inbox_.state(bytes, size, &state_)) {
    case Verdict::kIgnored:
      return;
    case Verdict::kDuplicate:
      commands_.command_again();
      return;
    case Verdict::kRestart:
      resetting_ = true;
      wake();
      if (belongs_to_restart(task_, last, state_.utime)) {
        tasks_.slot() = task_;
        tasks_.publish();
      }
      return;
    case Verdict::kNew:
      break;
  }
  if (resetting_) return;
  ++tally_.states;
  double tau[ENGRAM_NX_MAX];
  const engram_status status = engram_command(controller_, state_.utime, state_.q, state_.v, tau);
  report_status(report_, status, state_.utime, state_.seq);
  if (!commands_.command(state_, status, tau)) report_->note(Trouble::kPublish, state_.utime, state_.seq);
  State& s = states_.slot();
  s.utime = state_.utime;
  std::memcpy(s.q, state_.q, sizeof s.q);
  std::memcpy(s.v, state_.v, sizeof s.v);
  states_.publish();
  if (state_.utime >= tick_) wake();
}

void Wall::on_task(const void* bytes, uint32_t size) {
  if (inbox_.task(bytes, size, &task_) != Verdict::kNew) return;
  tasks_.slot() = task_;
  tasks_.publish();
}

void Wall::plan() {
  if (realtime_) go_realtime(kPlannerPriority);
  engram_cycle cycle;
  for (;;) {
    while (sem_wait(&wake_) != 0 && errno == EINTR) {
    }
    if (stopping_) return;
    if (resetting_) {
      engram_reset(controller_);
      tick_ = 0;
      states_.refresh();
      resetting_ = false;
      continue;
    }
    if (!states_.refresh() || states_.value().utime < tick_) continue;
    const State& s = states_.value();
    engram_feedback(controller_, s.utime, s.q, s.v);
    engram_cycle_info(controller_, &cycle);
    tally_.take(cycle);
    if (!cycles_.cycle(cycle) || !cycles_.timing(cycle)) planner_report_.note(Trouble::kPublish, cycle.utime, cycle.seq);
    notes_->cycle(controller_, cycle);
    if (tasks_.refresh()) {
      const engram_msg_task_t& task = tasks_.value();
      report_status(&planner_report_, engram_set_task(controller_, task.utime, task.jump, task.value, task.n), task.utime,
                    task.seq);
    }
    tick_ = s.utime + about_.tick_us;
    engram_prepare(controller_, tick_);
  }
}

}  // namespace engram::io
