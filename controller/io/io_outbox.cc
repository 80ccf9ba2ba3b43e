#include "controller/io/io_outbox.h"

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
  static_assert(sizeof(engram_msg_cycle_t::merit) == sizeof(engram_cycle::merit), "as many guesses in cycle_t as in engram.h");
  static_assert(sizeof(engram_msg_cycle_t::path) == sizeof(engram_cycle::path), "as many knots in cycle_t as in engram.h");
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
    m.candidate[i] = c.guess[i];
    m.merit[i] = c.merit[i];
  }
  m.cost = c.cost;
  m.gap = c.gap;
  m.clearance = c.clearance;
  m.trust = c.trust;
  m.npath = c.npath;
  std::memcpy(m.path, c.path, sizeof(double[3]) * static_cast<size_t>(c.npath));
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
  return send(kTimingChannel, bytes_, encode(bytes_, sizeof bytes_, m));
}

}  // namespace engram::io
