// Wall clock: commands leave the moment a state arrives, on the caller's thread; plans are made on a thread of their own. The two
// exchange states, tasks and (inside the controller) plans through single slots, without locks.
#ifndef CONTROLLER_IO_IO_WALL_H_
#define CONTROLLER_IO_IO_WALL_H_

#include <semaphore.h>

#include <atomic>
#include <thread>

#include "controller/io/io_lockstep.h"
#include "controller/loop/loop_exchange.h"

namespace engram::io {

class Wall {
 public:
  // commands: sender of the caller's thread; cycles: sender of the planner's thread.
  Wall(engram_controller* controller, Sender commands, Sender cycles, Notes* notes, Report* report, bool realtime);
  ~Wall();
  Wall(const Wall&) = delete;
  Wall& operator=(const Wall&) = delete;

  void on_state(const void* bytes, uint32_t size);
  void on_task(const void* bytes, uint32_t size);
  // Ends the planner's thread; afterwards the tally is complete.
  void stop();
  const Tally& tally() const { return tally_; }

 private:
  struct State {
    int64_t utime;
    double q[64], v[64];
  };
  void plan();
  void wake() { sem_post(&wake_); }

  engram_controller* controller_;
  const engram_description& about_;
  Report* report_;
  Notes* notes_;
  const bool realtime_;

  // caller's thread
  Inbox inbox_;
  Outbox commands_;
  engram_msg_state_t state_ = {};
  engram_msg_task_t task_ = {};

  // between the threads
  Exchange<State> states_;
  Exchange<engram_msg_task_t> tasks_;
  std::atomic<int64_t> tick_{0};        // us, time of the next feedback
  std::atomic<bool> resetting_{false};  // no commands until the planner has reset the controller
  std::atomic<bool> stopping_{false};
  sem_t wake_;

  // planner's thread
  Outbox cycles_;
  Report planner_report_;
  Tally tally_;
  std::thread thread_;
};

}  // namespace engram::io
#endif  // CONTROLLER_IO_IO_WALL_H_
