// A single-slot exchange between one writer and one reader thread: the reader sees the newest whole value. No locks, no waiting.
#ifndef CONTROLLER_LOOP_LOOP_EXCHANGE_H_
#define CONTROLLER_LOOP_LOOP_EXCHANGE_H_

#include <atomic>
#include <cstdint>

namespace engram {

// Three slots: the writer fills one, the reader holds one, the third carries the newest value from hand to hand.
template <class T> class Exchange {
 public:
  // Writer: the slot to fill. Its old content is arbitrary.
  T& slot() { return slots_[write_]; }
  // Writer: hands the slot over.
  void publish() { write_ = middle_.exchange(static_cast<uint8_t>(write_ | kFresh), std::memory_order_acq_rel) & kIndex; }

  // Reader: true if something was published since the last call. The value stays untouched until the next call.
  bool refresh() {
    if (!(middle_.load(std::memory_order_relaxed) & kFresh)) return false;
    read_ = middle_.exchange(read_, std::memory_order_acq_rel) & kIndex;
    return true;
  }
  const T& value() const { return slots_[read_]; }

 private:
  static constexpr uint8_t kIndex = 3, kFresh = 4;
  T slots_[3] = {};
  uint8_t write_ = 0, read_ = 1;
  std::atomic<uint8_t> middle_{2};
};

}  // namespace engram
#endif  // CONTROLLER_LOOP_LOOP_EXCHANGE_H_
