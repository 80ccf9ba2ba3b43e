#include "controller/io/io_transport.h"

#include <cstdio>

namespace engram::io {
namespace {
constexpr int kQueue = 100;  // messages kept while the control thread computes: a tenth of a second of states
}

Transport::~Transport() {
  if (lcm_ != nullptr) lcm_destroy(lcm_);
}

bool Transport::open(const char* url) {
  lcm_ = lcm_create(*url != '\0' ? url : nullptr);
  if (lcm_ != nullptr) return true;
  std::fprintf(stderr,
               "engram-controller: cannot open LCM at '%s': no multicast route or a malformed URL; as root: ip link set lo up; "
               "ip route add 239.255.76.67/32 dev lo\n",
               url);
  return false;
}

void Transport::listen(const char* channel, Handle handle, void* context) {
  Listener* const l = &listeners_[nlisteners_++];
  *l = {channel, handle, context, lcm_subscribe(lcm_, channel, receive_bytes, l)};
  if (l->subscription != nullptr) lcm_subscription_set_queue_capacity(l->subscription, kQueue);
}

void Transport::stop_listening(const char* channel) {
  for (Listener& l : listeners_) {
    if (l.subscription == nullptr || std::strcmp(l.channel, channel) != 0) continue;
    lcm_unsubscribe(lcm_, l.subscription);
    l.subscription = nullptr;
  }
}

bool Transport::receive(int milliseconds) { return lcm_handle_timeout(lcm_, milliseconds) >= 0; }

bool Transport::send(void* self, const char* channel, const void* bytes, uint32_t size) {
  return lcm_publish(static_cast<Transport*>(self)->lcm_, channel, bytes, size) == 0;
}

void Transport::receive_bytes(const lcm_recv_buf_t* buffer, const char*, void* listener) {
  const Listener& l = *static_cast<const Listener*>(listener);
  l.handle(l.context, buffer->data, buffer->data_size);
}

}  // namespace engram::io
