// The plant's side of the LCM link: state and task out, command, cycle and timing in.
#ifndef ENGRAM_SIM_HARNESS_SIM_LINK_H_
#define ENGRAM_SIM_HARNESS_SIM_LINK_H_

#include <lcm/lcm.h>

#include <cstdint>
#include <cstdio>
#include <string>

#include "engram_msg_command_t.h"
#include "engram_msg_cycle_t.h"
#include "engram_msg_state_t.h"
#include "engram_msg_task_t.h"
#include "engram_msg_timing_t.h"
#include "sim_harness/sim_log.h"

namespace engram::sim {

constexpr char kStateChannel[] = "ENGRAM_STATE";
constexpr char kTaskChannel[] = "ENGRAM_TASK";
constexpr char kCommandChannel[] = "ENGRAM_COMMAND";
constexpr char kCycleChannel[] = "ENGRAM_CYCLE";
constexpr char kTimingChannel[] = "ENGRAM_TIMING";

// Messages that were refused, by reason.
struct Refused {
  int64_t malformed = 0;      // wrong size or fingerprint
  int64_t foreign_robot = 0;  // digest of another robot, or another number of torques
  int64_t not_finite = 0;
  int64_t second_answer = 0;  // more answers to a state than times it was sent: a second controller
  int64_t total() const { return malformed + foreign_robot + not_finite + second_answer; }
};

class Link {
 public:
  ~Link();
  Link() = default;
  Link(const Link&) = delete;
  Link& operator=(const Link&) = delete;

  // Opens LCM at `url`. `log` takes the accepted messages it keeps, of the cycles those of kept states and the first of every jump; `timing` (CSV, may be null) takes timing_t.
  std::string open(const char* url, uint64_t robot_digest, int nu, EventLog* log, std::FILE* timing);

  // Both encode into static buffers and publish; resend() publishes the same bytes again. A state with seq 1 begins an episode.
  void publish_state(const engram_msg_state_t& state);
  void publish_task(const engram_msg_task_t& task);
  void resend();
  void resend_task();

  const void* state_bytes() const { return state_buffer_; }
  const void* task_bytes() const { return task_buffer_; }
  int state_size() const { return state_size_; }
  int task_size() const { return task_size_; }

  // Handles messages for at most `milliseconds`; returns early once the current state is answered.
  bool wait_answer(int milliseconds);
  // Handles what has arrived.
  void drain();

  bool answered() const { return answered_; }
  const engram_msg_command_t& command() const { return command_; }  // the latest accepted one; seq 0 before the first
  const Refused& refused() const { return refused_; }
  int64_t resends() const { return resends_; }

 private:
  static void on_command(const lcm_recv_buf_t* buf, const char* channel, void* self);
  static void on_cycle(const lcm_recv_buf_t* buf, const char* channel, void* self);
  static void on_timing(const lcm_recv_buf_t* buf, const char* channel, void* self);
  void refuse(int64_t* counter, const char* what);

  lcm_t* lcm_ = nullptr;
  EventLog* log_ = nullptr;
  std::FILE* timing_ = nullptr;
  uint64_t robot_digest_ = 0;
  int nu_ = 0;

  uint8_t state_buffer_[2048], task_buffer_[1024];
  int state_size_ = 0, task_size_ = 0;
  int64_t seq_ = 0, restart_utime_ = 0;
  static constexpr int kRing = 16;
  struct {
    int64_t seq;
    int sends, answers;
  } recent_[kRing]{};  // of the last states, at seq % kRing
  bool answered_ = false;
  engram_msg_command_t command_{};
  Refused refused_;
  int64_t resends_ = 0;
  int32_t jump_ = 0;  // of the last cycle
};

}  // namespace engram::sim

#endif  // ENGRAM_SIM_HARNESS_SIM_LINK_H_
