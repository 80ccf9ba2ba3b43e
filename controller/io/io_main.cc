// engram-controller: the deployed program.
#include <csignal>
#include <cstdio>
#include <ctime>
#include <memory>
#include <optional>
#include <vector>

#include "controller/io/io_exit.h"
#include "controller/io/io_lockstep.h"
#include "controller/io/io_presence.h"
#include "controller/io/io_realtime.h"
#include "controller/io/io_settings.h"
#include "controller/io/io_transport.h"
#include "controller/io/io_wall.h"

namespace engram::io {
namespace {

constexpr int kListenMs = 300;  // how long a newcomer listens for others
constexpr int kPollMs = 100;
constexpr double kSilence = 1.0;  // s without a state that deserve a word
constexpr int kPriority = 60;

volatile std::sig_atomic_t interrupted = 0;
void interrupt(int) { interrupted = 1; }

double wall_seconds() {
  timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

int64_t unique_id() {
  timespec t;
  clock_gettime(CLOCK_REALTIME, &t);
  return static_cast<int64_t>(t.tv_sec) * 1000000000 + t.tv_nsec;
}

class Program {
 public:
  explicit Program(const Settings& settings) : settings_(settings), notes_(&report_) {}
  int run();

 private:
  // What arrived before we knew whether we may serve.
  struct Kept {
    std::vector<uint8_t> bytes;
    void take(const void* data, uint32_t size) {
      const auto* const first = static_cast<const uint8_t*>(data);
      bytes.assign(first, first + size);
    }
  };
  bool ask_to_serve();
  void serve();
  void on_state(const void* bytes, uint32_t size);
  void on_task(const void* bytes, uint32_t size);
  void summarize();

  const Settings& settings_;
  Report report_;
  Notes notes_;
  Transport transport_, planner_transport_;
  std::optional<Presence> presence_;
  std::optional<Lockstep> lockstep_;
  std::optional<Wall> wall_;
  Kept state_, task_;
  double last_state_ = 0;
  int64_t states_ = 0;
};

void Program::on_state(const void* bytes, uint32_t size) {
  last_state_ = wall_seconds();
  ++states_;
  if (lockstep_) lockstep_->on_state(bytes, size);
  else if (wall_) wall_->on_state(bytes, size);
  else state_.take(bytes, size);
}

void Program::on_task(const void* bytes, uint32_t size) {
  if (lockstep_) lockstep_->on_task(bytes, size);
  else if (wall_) wall_->on_task(bytes, size);
  else task_.take(bytes, size);
}

bool Program::ask_to_serve() {
  presence_.emplace(unique_id(), transport_.sender());
  transport_.listen(
      kPresenceChannel, [](void* p, const void* b, uint32_t n) { static_cast<Presence*>(p)->on_presence(b, n); }, &*presence_);
  transport_.listen(
      kCommandChannel, [](void* p, const void*, uint32_t) { static_cast<Presence*>(p)->on_command(); }, &*presence_);
  presence_->ask();
  const double end = wall_seconds() + 1e-3 * kListenMs;
  for (double left; !interrupted && !presence_->taken() && (left = end - wall_seconds()) > 0;) {
    transport_.receive(1 + static_cast<int>(1e3 * left));
  }
  transport_.stop_listening(kCommandChannel);
  if (!presence_->taken()) return presence_->serve(), true;
  std::fprintf(
      stderr,
      "engram-controller: another controller serves on this network already: leaving it the robot; stop it first, or choose "
      "another --lcm-url\n");
  return false;
}

void Program::serve() {
  std::printf("engram-controller %s: %s %s, %s, ready\n", engram_version(), engram_describe(settings_.model)->robot,
              engram_describe(settings_.model)->task, settings_.clock == Clock::kWall ? "wall clock" : "lock step");
  std::fflush(stdout);
  if (!task_.bytes.empty()) on_task(task_.bytes.data(), static_cast<uint32_t>(task_.bytes.size()));
  if (!state_.bytes.empty()) on_state(state_.bytes.data(), static_cast<uint32_t>(state_.bytes.size()));
  bool silent = true;
  while (!interrupted) {
    if (!transport_.receive(kPollMs) && !interrupted) {
      std::fprintf(stderr, "engram-controller: receiving failed: is the network down?\n");
      const timespec pause = {1, 0};
      nanosleep(&pause, nullptr);
    }
    const bool quiet = wall_seconds() - last_state_ > kSilence;
    if (quiet && !silent && states_ > 0) {
      std::fprintf(stderr, "engram-controller: no ENGRAM_STATE for %.0f s: waiting for the plant\n", kSilence);
    }
    silent = quiet;
  }
}

void Program::summarize() {
  const Tally& t = lockstep_ ? lockstep_->tally() : wall_->tally();
  std::printf("engram-controller: %lld states, %lld cycles, CPU per cycle mean %.2f ms, max %.2f ms; rungs:",
              static_cast<long long>(t.states), static_cast<long long>(t.cycles),
              t.cycles ? 1e-3 * t.cycle_us_sum / static_cast<double>(t.cycles) : 0.0, 1e-3 * t.cycle_us_max);
  for (int r = 0; r < ENGRAM_RUNG_COUNT; ++r) {
    std::printf(" %s %lld", engram_rung_text(static_cast<engram_rung>(r)), static_cast<long long>(t.rung[r]));
  }
  std::printf("; ");
  report_.summarize(stdout);
  std::printf("\n");
  std::fflush(stdout);
}

int Program::run() {
  const size_t bytes = engram_sizeof(settings_.model);
  const std::unique_ptr<uint8_t[]> memory(new uint8_t[bytes]);
  engram_controller* controller = nullptr;
  const engram_error error = engram_init(settings_.model, memory.get(), bytes, &settings_.options, &controller);
  if (error != ENGRAM_NO_ERROR) {
    std::fprintf(stderr, "engram-controller: %s\n", engram_error_text(error));
    return kExitUsage;
  }
  if (!notes_.open_timing(settings_.timing) || !notes_.open_jumps(settings_.jumps, *engram_describe(settings_.model)))
    return kExitUsage;
  if (!transport_.open(settings_.lcm_url)) return kExitNetwork;
  transport_.listen(
      kStateChannel, [](void* p, const void* b, uint32_t n) { static_cast<Program*>(p)->on_state(b, n); }, this);
  transport_.listen(
      kTaskChannel, [](void* p, const void* b, uint32_t n) { static_cast<Program*>(p)->on_task(b, n); }, this);

  struct sigaction action = {};
  action.sa_handler = interrupt;
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);

  if (!ask_to_serve()) return kExitTaken;
  if (settings_.clock == Clock::kLockstep) {
    if (settings_.realtime) go_realtime(kPriority);
    lockstep_.emplace(controller, transport_.sender(), &notes_, &report_);
  } else {
    if (!planner_transport_.open(settings_.lcm_url)) return kExitNetwork;
    wall_.emplace(controller, transport_.sender(), planner_transport_.sender(), &notes_, &report_, settings_.realtime);
  }
  serve();
  if (wall_) wall_->stop();
  notes_.close();
  summarize();
  return kExitOk;
}

}  // namespace
}  // namespace engram::io

int main(int argc, char** argv) {
  engram::io::Settings settings;
  int exit_code = 0;
  const engram::io::Models models = {&engram_panda_reach, &engram_talos_stand, &engram_talos_walk,     &engram_talos_pole,
                                     &engram_anymal_trot, &engram_hector_fly,  &engram_pendulum_swing, &engram_unicycle_park,
                                     &engram_bicopter_fly};
  if (!engram::io::read_settings(argc, argv, models, &settings, &exit_code)) return exit_code;
  return engram::io::Program(settings).run();
}
