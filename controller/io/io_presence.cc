#include "controller/io/io_presence.h"

namespace engram::io {

bool Presence::say() {
  uint8_t bytes[sizeof(engram_msg_presence_t) + 16];
  const int size = encode(bytes, sizeof bytes, mine_);
  return size > 0 && sender_.send(sender_.context, kPresenceChannel, bytes, static_cast<uint32_t>(size));
}

void Presence::on_presence(const void* bytes, uint32_t size) {
  engram_msg_presence_t heard;
  if (read_message(bytes, size, &heard) != Decoded::kGood || heard.id == mine_.id) return;
  if (serving()) {
    if (heard.serving == 0) say();
  } else if (heard.serving == 1 || heard.id < mine_.id) {
    taken_ = true;
  } else {
    say();  // we were first: let the other one know
  }
}

}  // namespace engram::io
