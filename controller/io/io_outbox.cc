#include "controller/io/io_outbox.h"

#include <type_traits>

namespace engram::io {

bool Outbox::command(const engram_msg_state_t& state, engram_status status, const double* tau) {
  engram_msg_command_t m = {};
  m.utime = state.utime;
  m.seq = state.seq;
  m.robot_digest = static_cast<int64_t>(about_.robot_digest);
  m.status = status;
  m.nu = about_.nu;
  std::memcpy(m.tau, tau, sizeof(double) * static_cast<size_t>(about_.nu));
  command_size_ = encode(command_bytes_, sizeof command_bytes_, m);
  return command_again();
}

bool Outbox::cycle(const engram_cycle& c) {
  static_assert(std::extent_v<decltype(engram_msg_cycle_t::merit)> == ENGRAM_GUESSES_MAX, "as many guesses in cycle_t as in engram.h");
  static_assert(std::extent_v<decltype(engram_msg_cycle_t::path)> == ENGRAM_KNOTS_MAX, "as many knots in cycle_t as in engram.h");
  engram_msg_cycle_t m = {};
  m.utime = c.utime;
  m.seq = c.seq;
  m.jump = c.jump;
  m.status = c.status;
  m.rung = c.rung;
  m.winner = c.winner;
  m.iterations = c.iterations;
  m.ncandidates = c.nguess;
  for (int i = 0; i < c.nguess; ++i) {
    m.candidate[i] = static_cast<int8_t>(c.guess[i]);
    m.merit[i] = static_cast<float>(c.merit[i]);
  }
  m.cost = c.cost;
  m.gap = c.gap;
  m.clearance = c.clearance;
  m.trust = c.trust;
  m.npath = c.npath;
  for (int k = 0; k < c.npath; ++k)
    for (int i = 0; i < 3; ++i) m.path[k][i] = static_cast<float>(c.path[k][i]);
  static_assert(std::extent_v<decltype(engram_msg_cycle_t::foot)> == ENGRAM_FEET_MAX, "as many feet in cycle_t as in engram.h");
  m.nfeet = c.legs.nfeet;
  m.swing = c.legs.swing;
  for (int f = 0; f < c.legs.nfeet; ++f)
    for (int i = 0; i < 4; ++i) m.foot[f][i] = static_cast<float>(c.legs.foot[f][i]);
  for (int i = 0; i < 3; ++i) m.com[i] = static_cast<float>(c.legs.com[i]);
  return send(kCycleChannel, bytes_, encode(bytes_, sizeof bytes_, m));
}

bool Outbox::timing(const engram_cycle& c) {
  engram_msg_timing_t m = {};
  m.utime = c.utime;
  m.seq = c.seq;
  m.query = c.query_us;
  m.candidates = c.candidates_us;
  m.linearize = c.linearize_us;
  m.backward = c.backward_us;
  m.rollout = c.rollout_us;
  m.total = c.total_us;
  static_assert(std::extent_v<decltype(m.asked)> == ENGRAM_CANDIDATE_COUNT, "as many kinds in timing_t as in engram.h");
  for (int i = 0; i < ENGRAM_CANDIDATE_COUNT; ++i) m.asked[i] = static_cast<float>(c.asked_us[i]);
  return send(kTimingChannel, bytes_, encode(bytes_, sizeof bytes_, m));
}

}  // namespace engram::io
