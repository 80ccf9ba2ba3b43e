// The LCM messages as bytes: fixed size, so that encoding needs a static buffer and decoding no heap.
#ifndef CONTROLLER_IO_IO_MESSAGE_H_
#define CONTROLLER_IO_IO_MESSAGE_H_

#include <cstdint>
#include <cstring>

#include "engram_msg_command_t.h"
#include "engram_msg_cycle_t.h"
#include "engram_msg_presence_t.h"
#include "engram_msg_state_t.h"
#include "engram_msg_task_t.h"
#include "engram_msg_timing_t.h"

namespace engram::io {

inline constexpr char kStateChannel[] = "ENGRAM_STATE";
inline constexpr char kTaskChannel[] = "ENGRAM_TASK";
inline constexpr char kCommandChannel[] = "ENGRAM_COMMAND";
inline constexpr char kCycleChannel[] = "ENGRAM_CYCLE";
inline constexpr char kTimingChannel[] = "ENGRAM_TIMING";
inline constexpr char kPresenceChannel[] = "ENGRAM_PRESENCE";

// One overload set over the functions that lcm-gen writes per type.
#define ENGRAM_IO_MESSAGE(M)                                                                      \
  inline int encoded_size(const M& m) { return M##_encoded_size(&m); }                            \
  inline int encode(void* bytes, int size, const M& m) { return M##_encode(bytes, 0, size, &m); } \
  inline int decode(const void* bytes, int size, M* m) { return M##_decode(bytes, 0, size, m); }  \
  inline uint64_t fingerprint(const M&) { return static_cast<uint64_t>(__##M##_get_hash()); }
ENGRAM_IO_MESSAGE(engram_msg_state_t)
ENGRAM_IO_MESSAGE(engram_msg_task_t)
ENGRAM_IO_MESSAGE(engram_msg_command_t)
ENGRAM_IO_MESSAGE(engram_msg_cycle_t)
ENGRAM_IO_MESSAGE(engram_msg_timing_t)
ENGRAM_IO_MESSAGE(engram_msg_presence_t)
#undef ENGRAM_IO_MESSAGE

enum class Decoded { kGood, kWrongSize, kForeign };

// Reads `size` bytes as a message of type M. `*m` is written only if all is well.
template <class M> Decoded read_message(const void* bytes, uint32_t size, M* m) {
  M heard = {};
  const int expected = encoded_size(heard);
  if (size < sizeof(uint64_t)) return Decoded::kWrongSize;
  uint64_t print = 0;
  for (int i = 0; i < 8; ++i) print = print << 8 | static_cast<const uint8_t*>(bytes)[i];
  if (print != fingerprint(heard)) return Decoded::kForeign;
  if (size != static_cast<uint32_t>(expected)) return Decoded::kWrongSize;
  if (decode(bytes, expected, &heard) != expected) return Decoded::kWrongSize;
  *m = heard;
  return Decoded::kGood;
}

}  // namespace engram::io
#endif  // CONTROLLER_IO_IO_MESSAGE_H_
