// LCM, wrapped: opens the network with a word on what to do if it cannot, sends bytes, hands received bytes to plain functions.
#ifndef CONTROLLER_IO_IO_TRANSPORT_H_
#define CONTROLLER_IO_IO_TRANSPORT_H_

#include <lcm/lcm.h>

#include "controller/io/io_outbox.h"

namespace engram::io {

class Transport {
 public:
  Transport() = default;
  ~Transport();
  Transport(const Transport&) = delete;
  Transport& operator=(const Transport&) = delete;

  // False with a message on stderr if there is no such network. "" stands for LCM's default.
  bool open(const char* url);
  // `handle(context, bytes, size)` for every message of a channel, from within receive().
  typedef void (*Handle)(void* context, const void* bytes, uint32_t size);
  void listen(const char* channel, Handle handle, void* context);
  void stop_listening(const char* channel);
  // Waits up to `milliseconds` for one message and hands it over. False if the network failed.
  bool receive(int milliseconds);
  Sender sender() { return {send, this}; }
  bool send_bytes(const char* channel, const void* bytes, uint32_t size) { return send(this, channel, bytes, size); }

 private:
  struct Listener {
    const char* channel;
    Handle handle;
    void* context;
    lcm_subscription_t* subscription;
  };
  static bool send(void* self, const char* channel, const void* bytes, uint32_t size);
  static void receive_bytes(const lcm_recv_buf_t* buffer, const char* channel, void* listener);

  lcm_t* lcm_ = nullptr;
  Listener listeners_[4] = {};
  int nlisteners_ = 0;
};

}  // namespace engram::io
#endif  // CONTROLLER_IO_IO_TRANSPORT_H_
