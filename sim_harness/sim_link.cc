#include "sim_harness/sim_link.h"

#include <chrono>
#include <cmath>
#include <type_traits>

namespace engram::sim {

namespace {
constexpr int kKinds = std::extent_v<decltype(engram_msg_timing_t::asked)>;  // of guesses
}

Link::~Link() {
  if (lcm_) lcm_destroy(lcm_);
}

std::string Link::open(const char* url, uint64_t robot_digest, int nu, EventLog* log, std::FILE* timing) {
  robot_digest_ = robot_digest, nu_ = nu, log_ = log, timing_ = timing;
  lcm_ = lcm_create(url);
  if (!lcm_) {
    return std::string("cannot open LCM at '") + url +
           "': no multicast route or a malformed URL; as root: ip link set lo up; ip route add 239.255.76.67/32 dev lo";
  }
  lcm_subscribe(lcm_, kCommandChannel, on_command, this);
  lcm_subscribe(lcm_, kCycleChannel, on_cycle, this);
  lcm_subscribe(lcm_, kTimingChannel, on_timing, this);
  if (timing_) {
    std::fprintf(timing_, "utime,seq,query_us,candidates_us,linearize_us,backward_us,rollout_us,total_us");
    for (int i = 0; i < kKinds; ++i) std::fprintf(timing_, ",asked%d_us", i);
    std::fprintf(timing_, "\n");
  }
  return "";
}

void Link::publish_state(const engram_msg_state_t& state) {
  state_size_ = engram_msg_state_t_encode(state_buffer_, 0, sizeof state_buffer_, &state);
  if (state.seq == 1) {  // an episode begins: answers to the last one are of no use any more
    restart_utime_ = state.utime;
    command_ = {};
  }
  seq_ = state.seq, answered_ = false;
  recent_[seq_ % kRing] = {seq_, 1, 0};
  lcm_publish(lcm_, kStateChannel, state_buffer_, state_size_);
}

void Link::publish_task(const engram_msg_task_t& task) {
  task_size_ = engram_msg_task_t_encode(task_buffer_, 0, sizeof task_buffer_, &task);
  lcm_publish(lcm_, kTaskChannel, task_buffer_, task_size_);
}

void Link::resend_task() {
  if (task_size_ > 0) lcm_publish(lcm_, kTaskChannel, task_buffer_, task_size_);
}

void Link::resend() {
  resend_task();
  lcm_publish(lcm_, kStateChannel, state_buffer_, state_size_);
  ++recent_[seq_ % kRing].sends, ++resends_;
}

bool Link::wait_answer(int milliseconds) {
  using Clock = std::chrono::steady_clock;
  const auto end = Clock::now() + std::chrono::milliseconds(milliseconds);
  while (!answered_) {
    const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(end - Clock::now()).count();
    if (left <= 0 || lcm_handle_timeout(lcm_, static_cast<int>(left)) < 0) break;
  }
  return answered_;
}

void Link::drain() {
  while (lcm_handle_timeout(lcm_, 0) > 0) {
  }
}

void Link::refuse(int64_t* counter, const char* what) {
  if (++*counter == 1) std::fprintf(stderr, "engram-plant: refused a message: %s (said once)\n", what);
}

void Link::on_command(const lcm_recv_buf_t* buf, const char*, void* self) {
  Link& link = *static_cast<Link*>(self);
  engram_msg_command_t command;
  if (engram_msg_command_t_decode(buf->data, 0, static_cast<int>(buf->data_size), &command) != static_cast<int>(buf->data_size)) {
    return link.refuse(&link.refused_.malformed,
                       "ENGRAM_COMMAND is truncated or of another type; build both sides from one checkout");
  }
  if (static_cast<uint64_t>(command.robot_digest) != link.robot_digest_ || command.nu != link.nu_) {
    return link.refuse(&link.refused_.foreign_robot,
                       "ENGRAM_COMMAND is for another robot; build controller and scene from one checkout");
  }
  for (int i = 0; i < link.nu_; ++i) {
    if (!std::isfinite(command.tau[i]))
      return link.refuse(&link.refused_.not_finite, "ENGRAM_COMMAND holds a torque that is not finite");
  }
  if (command.utime < link.restart_utime_) return;
  if (command.seq < 1 || command.seq > link.seq_) {
    return link.refuse(&link.refused_.malformed, "ENGRAM_COMMAND answers a state that was never sent");
  }
  auto& sent = link.recent_[command.seq % kRing];
  if (sent.seq == command.seq && ++sent.answers > sent.sends) {
    return link.refuse(&link.refused_.second_answer, "a state was answered twice on ENGRAM_COMMAND; stop the second controller");
  }
  if (command.seq <= link.command_.seq) return;  // answer to a repeated state
  link.command_ = command;
  link.answered_ = command.seq == link.seq_;
  if (link.log_->keeps(command.utime, command.seq))
    link.log_->add(command.utime, EventLog::kCommand, kCommandChannel, buf->data, static_cast<int>(buf->data_size));
}

void Link::on_cycle(const lcm_recv_buf_t* buf, const char*, void* self) {
  Link& link = *static_cast<Link*>(self);
  engram_msg_cycle_t cycle;
  if (engram_msg_cycle_t_decode(buf->data, 0, static_cast<int>(buf->data_size), &cycle) != static_cast<int>(buf->data_size)) {
    return link.refuse(&link.refused_.malformed,
                       "ENGRAM_CYCLE is truncated or of another type; build both sides from one checkout");
  }
  if (cycle.jump != link.jump_ || link.log_->holds_state(cycle.utime))
    link.log_->add(cycle.utime, EventLog::kCycle, kCycleChannel, buf->data, static_cast<int>(buf->data_size));
  link.jump_ = cycle.jump;
}

void Link::on_timing(const lcm_recv_buf_t* buf, const char*, void* self) {
  Link& link = *static_cast<Link*>(self);
  engram_msg_timing_t t;
  if (engram_msg_timing_t_decode(buf->data, 0, static_cast<int>(buf->data_size), &t) != static_cast<int>(buf->data_size)) {
    return link.refuse(&link.refused_.malformed,
                       "ENGRAM_TIMING is truncated or of another type; build both sides from one checkout");
  }
  if (!link.timing_) return;
  std::fprintf(link.timing_, "%lld,%lld,%.2f,%.2f,%.2f,%.2f,%.2f,%.2f", static_cast<long long>(t.utime),
               static_cast<long long>(t.seq), t.query, t.candidates, t.linearize, t.backward, t.rollout, t.total);
  for (float us : t.asked) std::fprintf(link.timing_, ",%.2f", us);
  std::fprintf(link.timing_, "\n");
}

}  // namespace engram::sim
