// The run's LCM event log, in an order that does not depend on when messages happened to arrive.
#ifndef ENGRAM_SIM_HARNESS_SIM_LOG_H_
#define ENGRAM_SIM_HARNESS_SIM_LOG_H_

#include <lcm/lcm.h>

#include <cstdint>
#include <string>
#include <vector>

namespace engram::sim {

// Events are kept for kHoldBack and written sorted by (utime, rank, arrival), with the message's utime as the event's time stamp.
// A full disk ends the log, not the run: one message, and truncated() from then on.
class EventLog {
 public:
  static constexpr int64_t kHoldBack = 50000;  // us; longer than any message of a cycle lies behind its utime
  enum Rank { kTask, kState, kCycle, kCommand };

  EventLog() = default;
  EventLog(const EventLog&) = delete;
  EventLog& operator=(const EventLog&) = delete;
  ~EventLog() { close(); }

  // Empty string, or one line that says what is wrong. After `full` us only each `every`-th state and its command are
  // wanted: keeps().
  std::string open(const char* path, int64_t full, int every);
  // Whether the log takes the state `seq` of time `utime`, and the command that answers it.
  bool keeps(int64_t utime, int64_t seq) const { return log_ && (utime < full_ || (seq - 1) % every_ == 0); }
  // Whether it has lately taken the state of time `utime`.
  bool holds_state(int64_t utime) const;
  void add(int64_t utime, Rank rank, const char* channel, const void* data, int size);
  void flush(int64_t now);  // writes what lies more than kHoldBack before `now`
  void close();             // writes the rest

  bool truncated() const { return truncated_; }
  int64_t events() const { return events_; }
  int64_t bytes() const { return bytes_; }

 private:
  struct Event {
    int64_t utime;
    int rank;
    const char* channel;
    std::string data;
  };
  void write_before(int64_t utime);
  void truncate();

  lcm_eventlog_t* log_ = nullptr;
  std::string path_;
  int64_t full_ = 0;
  int every_ = 1;
  std::vector<Event> pending_;
  std::vector<char> buffer_;
  bool truncated_ = false;
  int64_t events_ = 0, bytes_ = 0;
};

}  // namespace engram::sim

#endif  // ENGRAM_SIM_HARNESS_SIM_LOG_H_
