#include "sim_harness/sim_log.h"

#include <lcm/eventlog.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>

namespace engram::sim {

std::string EventLog::open(const char* path, int64_t full, int every) {
  std::signal(SIGXFSZ, SIG_IGN);  // a file size limit is an error of write(), like a full disk
  path_ = path, full_ = full, every_ = every;
  errno = 0;
  log_ = lcm_eventlog_create(path, "w");
  if (!log_) return "cannot write the log '" + path_ + "': " + std::strerror(errno);
  buffer_.resize(1 << 20);
  std::setvbuf(log_->f, buffer_.data(), _IOFBF, buffer_.size());
  return "";
}

void EventLog::add(int64_t utime, Rank rank, const char* channel, const void* data, int size) {
  if (log_) pending_.push_back({utime, rank, channel, std::string(static_cast<const char*>(data), size)});
}

bool EventLog::holds_state(int64_t utime) const {
  return std::any_of(pending_.rbegin(), pending_.rend(), [=](const Event& e) { return e.rank == kState && e.utime == utime; });
}

void EventLog::flush(int64_t now) {
  if (pending_.size() > 256) write_before(now - kHoldBack);
}

void EventLog::write_before(int64_t utime) {
  const auto earlier = [](const Event& a, const Event& b) { return a.utime != b.utime ? a.utime < b.utime : a.rank < b.rank; };
  std::stable_sort(pending_.begin(), pending_.end(), earlier);
  auto event = pending_.begin();
  for (; event != pending_.end() && event->utime < utime; ++event) {
    lcm_eventlog_event_t record{};
    record.timestamp = event->utime;
    record.channellen = static_cast<int32_t>(std::strlen(event->channel));
    record.datalen = static_cast<int32_t>(event->data.size());
    record.channel = const_cast<char*>(event->channel);
    record.data = &event->data[0];
    errno = 0;
    if (log_ && lcm_eventlog_write_event(log_, &record) != 0) truncate();
    if (!log_) break;
    ++events_;
    bytes_ += 28 + record.channellen + record.datalen;  // 28: LCM's event header
  }
  pending_.erase(pending_.begin(), log_ ? event : pending_.end());
}

void EventLog::truncate() {
  std::fprintf(stderr,
               "engram-plant: the log '%s' ends at event %lld: %s; the run goes on without it. Free some space and run again.\n",
               path_.c_str(), static_cast<long long>(events_), std::strerror(errno ? errno : EIO));
  truncated_ = true;
  lcm_eventlog_destroy(log_);
  log_ = nullptr;
}

void EventLog::close() {
  if (!log_) return;
  write_before(INT64_MAX);
  errno = 0;
  if (log_ && std::fflush(log_->f) != 0) truncate();
  if (log_) lcm_eventlog_destroy(log_);
  log_ = nullptr;
}

}  // namespace engram::sim
