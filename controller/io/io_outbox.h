// Messages on their way out: encoded into static buffers, handed to a sender. No heap.
#ifndef CONTROLLER_IO_IO_OUTBOX_H_
#define CONTROLLER_IO_IO_OUTBOX_H_

#include "controller/engram.h"
#include "controller/io/io_message.h"

namespace engram::io {

// Takes the bytes of one message; false if they could not be sent. LCM in the binary, a plain array in tests.
struct Sender {
  bool (*send)(void* context, const char* channel, const void* bytes, uint32_t size);
  void* context;
};

class Outbox {
 public:
  Outbox(const engram_description& about, Sender sender) : about_(about), sender_(sender) {}

  // The command for a state. Kept, so that the same state heard again gets the same bytes.
  bool command(const engram_msg_state_t& state, engram_status status, const double* tau);
  bool command_again() { return command_size_ == 0 || send(kCommandChannel, command_bytes_, command_size_); }
  bool cycle(const engram_cycle& cycle);   // cycle_t
  bool timing(const engram_cycle& cycle);  // timing_t
  void forget() { command_size_ = 0; }

 private:
  bool send(const char* channel, const void* bytes, int size) {
    return size > 0 && sender_.send(sender_.context, channel, bytes, static_cast<uint32_t>(size));
  }

  const engram_description& about_;
  Sender sender_;
  int command_size_ = 0;
  uint8_t command_bytes_[sizeof(engram_msg_command_t) + 64];
  uint8_t bytes_[sizeof(engram_msg_cycle_t) + 64];
};

}  // namespace engram::io
#endif  // CONTROLLER_IO_IO_OUTBOX_H_
