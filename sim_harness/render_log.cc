#include "sim_harness/render_log.h"

#include <lcm/eventlog.h>

#include <algorithm>
#include <cstring>

#include "sim_harness/sim_link.h"

namespace engram::sim {
namespace {

constexpr double kReach = 0.1;  // s around a range

bool is_channel(const lcm_eventlog_event_t& event, const char* name) {
  return event.channellen == static_cast<int32_t>(std::strlen(name)) && !std::memcmp(event.channel, name, event.channellen);
}

}  // namespace

std::string RunLog::read(const char* file, const std::vector<TimeRange>& ranges) {
  lcm_eventlog_t* log = lcm_eventlog_create(file, "r");
  if (!log) return std::string("cannot read the log '") + file + "'";
  const auto wanted = [&](int64_t utime) {
    const auto near = [t = 1e-6 * utime](const TimeRange& r) { return t > r.begin - kReach && t < r.end + kReach; };
    return ranges.empty() || std::any_of(ranges.begin(), ranges.end(), near);
  };
  int64_t last = 0;
  while (lcm_eventlog_event_t* event = lcm_eventlog_read_next_event(log)) {
    last = std::max(last, event->timestamp);
    if (is_channel(*event, kStateChannel)) {
      engram_msg_state_t m;
      if (wanted(event->timestamp) && engram_msg_state_t_decode(event->data, 0, event->datalen, &m) > 0 && m.nq >= 0 &&
          m.nq <= 64) {
        q[m.utime].assign(m.q, m.q + m.nq);
      }
    } else if (is_channel(*event, kTaskChannel)) {
      engram_msg_task_t m;
      if (engram_msg_task_t_decode(event->data, 0, event->datalen, &m) > 0 && m.n >= 0 && m.n <= 32) {
        task[m.utime].assign(m.value, m.value + m.n);
      }
    } else if (is_channel(*event, kCycleChannel)) {
      engram_msg_cycle_t m;
      if (wanted(event->timestamp) && engram_msg_cycle_t_decode(event->data, 0, event->datalen, &m) > 0 && m.npath >= 0 &&
          m.npath <= 64) {
        auto& points = path[m.utime];
        points.resize(m.npath);
        for (int k = 0; k < m.npath; ++k) std::copy_n(m.path[k], 3, points[k].begin());
      }
    }
    lcm_eventlog_free_event(event);
  }
  lcm_eventlog_destroy(log);
  end = 1e-6 * static_cast<double>(last);
  return q.empty() ? std::string("the log '") + file + "' holds no state of the wanted time" : "";
}

}  // namespace engram::sim
