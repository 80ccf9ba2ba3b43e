// Messages as bytes, and a wire that remembers what was sent on it.
#ifndef TESTS_SUPPORT_WIRE_H_
#define TESTS_SUPPORT_WIRE_H_

#include <string>
#include <vector>

#include "controller/io/io_outbox.h"
#include "tests/support/panda_plant.h"

namespace engram::test {

struct Sent {
  std::string channel;
  std::vector<uint8_t> bytes;
};

struct Wire {
  std::vector<Sent> sent;
  bool broken = false;
  io::Sender sender() {
    return {[](void* self, const char* channel, const void* bytes, uint32_t size) {
              Wire& wire = *static_cast<Wire*>(self);
              const auto* first = static_cast<const uint8_t*>(bytes);
              if (!wire.broken) wire.sent.push_back({channel, {first, first + size}});
              return !wire.broken;
            },
            this};
  }
  // The last message of a channel; empty if there is none.
  std::vector<uint8_t> last(const char* channel) const {
    for (auto it = sent.rbegin(); it != sent.rend(); ++it)
      if (it->channel == channel) return it->bytes;
    return {};
  }
  int count(const char* channel) const {
    int n = 0;
    for (const Sent& s : sent) n += s.channel == channel;
    return n;
  }
};

template <class M> std::vector<uint8_t> bytes_of(const M& m) {
  std::vector<uint8_t> bytes(static_cast<size_t>(io::encoded_size(m)));
  io::encode(bytes.data(), static_cast<int>(bytes.size()), m);
  return bytes;
}

inline engram_msg_state_t state_message(const PandaPlant& plant, int64_t seq) {
  engram_msg_state_t m = {};
  m.utime = plant.utime;
  m.seq = seq;
  m.robot_digest = static_cast<int64_t>(robots::Panda::digest);
  m.nq = m.nv = 7;
  std::memcpy(m.q, plant.q, sizeof plant.q);
  std::memcpy(m.v, plant.v, sizeof plant.v);
  return m;
}

inline engram_msg_task_t task_message(const double* value, int64_t utime, int64_t seq, int32_t jump) {
  engram_msg_task_t m = {};
  m.utime = utime;
  m.seq = seq;
  m.task_digest = static_cast<int64_t>(engram_describe(&engram_panda_reach)->task_digest);
  m.jump = jump;
  m.n = 7;
  std::memcpy(m.value, value, 7 * sizeof *value);
  return m;
}

}  // namespace engram::test
#endif  // TESTS_SUPPORT_WIRE_H_
