// engram-plant: the robot and its world in MuJoCo, on LCM.
//
// One step of the plant, 1 ms:
//   publish task (at a jump, while the target moves) and state of time t
//   mj_step1: positions, velocities, contacts of time t; judge them; write the log      -- while the controller computes
//   lock step: wait for the command that answers this state;  wall clock: take the latest one
//   mj_step2: apply tau, integrate to t + 1 ms
#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstring>
#include <ctime>

#include "sim_harness/sim_faults.h"
#include "sim_harness/sim_flight.h"
#include "sim_harness/sim_formula.h"
#include "sim_harness/sim_judge.h"
#include "sim_harness/sim_link.h"
#include "sim_harness/sim_log.h"
#include "sim_harness/sim_model.h"
#include "sim_harness/sim_options.h"
#include "sim_harness/sim_scenario.h"
#include "sim_harness/sim_series.h"

namespace engram::sim {
namespace {

constexpr int kTaskRepeat = 500;  // steps; on the wall clock the task is repeated for a controller that starts late

enum ExitCode { kOk = 0, kBadInput = 2, kLogTruncated = 3, kNoController = 4, kDiverged = 5, kStopped = 130 };

volatile std::sig_atomic_t stopped = 0;  // by SIGINT or SIGTERM: the log is closed and the results are written

struct PlantOptions {
  std::string scene, series, scenario, log, results, timing;
  std::string engine = "mujoco";
  std::string clock = "lockstep";
  std::string url = "udpm://239.255.76.67:7667?ttl=0&recv_buf_size=4000000";
  double duration = 0;    // s; 0: until the series ends
  double log_full = 1e9;  // s
  int log_every = 10;     // steps
  double give_up = 10;    // s
  int resend_ms = 250;    // ms
  double stale_ms = 20;   // ms
  double damping = 2.0;   // N m s/rad
  uint64_t robot_digest = 0;
  FaultOptions faults;
};

constexpr char kAbout[] =
    "engram-plant: simulates the robot of a scene (1 kHz, torque control) and talks LCM: state_t and task_t out, command_t,\n"
    "cycle_t and timing_t in. Runs and judges a series of targets to reach, or a scenario to get through.\n"
    "Exit code: 0 done, 2 bad input, 3 done but the log is cut short, 4 no controller answers, 5 the simulation diverged,\n"
    "64 wrong option, 130 stopped by a signal.";

PlantOptions read_options(int argc, char** argv) {
  PlantOptions o;
  parse_options(
      argc, argv, kAbout,
      {{"--scene", "FILE", "MJCF of robot and world", &o.scene},
       {"--engine", "mujoco|cvode", "cvode: integrate a free body on thrusters, or a formula, to 1e-12; default mujoco", &o.engine},
       {"--series", "FILE", "targets to reach (sim_harness/sim_series.h)", &o.series},
       {"--scenario", "FILE", "episodes to get through (sim_harness/sim_scenario.h); without either, just simulate", &o.scenario},
       {"--duration", "S", "end after this much simulated time; default: when series or scenario end", &o.duration},
       {"--lcm-url", "URL", "LCM provider; default udpm on port 7667, ttl 0", &o.url},
       {"--clock", "lockstep|wall", "wait for each command (reproducible), or keep real time", &o.clock},
       {"--log", "FILE", "LCM event log of state, task, cycle and command", &o.log},
       {"--log-full", "S", "log every state of the first S seconds; default all (what engram replay can repeat)", &o.log_full},
       {"--log-every", "N", "after that, log each N-th state, its command and cycle; default 10", &o.log_every},
       {"--timing", "FILE", "CSV of the controller's CPU times", &o.timing},
       {"--results", "FILE", "JSON: how each jump ended, and counts", &o.results},
       {"--give-up", "S", "end if no command comes for this long (wall clock: no first one); default 10", &o.give_up},
       {"--resend-ms", "MS", "lock step: send the state again after this long; default 250", &o.resend_ms},
       {"--stale-ms", "MS", "wall clock: brake if the last command is older than this; default 20", &o.stale_ms},
       {"--damping", "D", "wall clock: joint damping while braking (N m s/rad); default 2", &o.damping},
       {"--robot-digest", "HEX", "digest of the robot, if neither scene nor series has it", &o.robot_digest},
       {"--seed", "N", "seed of noise and random pushes; default 1", &o.faults.seed},
       {"--noise-q", "RAD", "standard deviation of measured joint positions", &o.faults.noise_q},
       {"--noise-v", "RAD/S", "standard deviation of measured velocities", &o.faults.noise_v},
       {"--latency", "STEPS", "plant steps from a command to its effect", &o.faults.latency},
       {"--push", "T,BODY,FX,FY,FZ,D", "force (N, world) on a body from T for D seconds; may be repeated", &o.faults.pushes},
       {"--random-push-period", "S", "mean time between random pushes", &o.faults.random_push.period},
       {"--random-push-force", "N", "their largest force", &o.faults.random_push.force},
       {"--random-push-duration", "S", "their duration; default 0.1", &o.faults.random_push.duration},
       {"--gust-period", "S", "mean time between gusts of wind, forces that grow and fade", &o.faults.gust.period},
       {"--gust-force", "N", "their largest force", &o.faults.gust.force},
       {"--gust-duration", "S", "their duration; default 0.1", &o.faults.gust.duration}});
  return o;
}

class Plant {
 public:
  explicit Plant(const PlantOptions& options)
      : o_(options), lock_step_(options.clock == "lockstep"), judge_(series_), referee_(scenario_) {}
  ~Plant() {
    if (timing_) std::fclose(timing_);
  }
  Plant(const Plant&) = delete;
  Plant& operator=(const Plant&) = delete;

  std::string init();
  ExitCode run();
  std::string write_results(double wall_seconds) const;

 private:
  std::string read_script();
  void begin_step();
  bool wait_for_command();
  ExitCode answer_step();
  void brake(double* tau) const;
  bool finished() const;

  const PlantOptions o_;
  const bool lock_step_;
  Model model_;
  Series series_;
  Scenario scenario_;
  Judge judge_;
  Referee referee_;
  Script* script_ = nullptr;  // judge_ or referee_
  Flight flight_;    // one of them, if the engine is cvode
  Formula formula_;
  Faults faults_;
  EventLog log_;
  Link link_;
  std::FILE* timing_ = nullptr;
  engram_msg_state_t state_{};
  engram_msg_task_t task_{};
  double t_ = 0;                     // s, plant clock
  int64_t utime_ = 0, step_us_ = 0;  // us, the same clock
  int64_t steps_ = 0, stale_steps_ = 0;
};

std::string Plant::init() {
  if (!lock_step_ && o_.clock != "wall") return "--clock takes lockstep or wall";
  if (o_.scene.empty()) return "--scene is missing; see --help";
  if (o_.engine != "mujoco" && o_.engine != "cvode") return "--engine takes mujoco or cvode";
  if (!o_.series.empty() && !o_.scenario.empty()) return "give --series or --scenario, not both; see --help";
  if (o_.series.empty() && o_.scenario.empty() && o_.duration <= 0) return "give --series, --scenario or --duration; see --help";
  if (o_.log_every < 1 || o_.faults.latency < 0) return "--log-every must be at least 1 and --latency at least 0";
  std::string wrong = model_.load(o_.scene.c_str());
  if (!wrong.empty()) return wrong;
  const bool formula = !model_.formula.empty(), cvode = o_.engine == "cvode";
  if (formula && !cvode) return "this scene is moved by the formula '" + model_.formula + "', not by MuJoCo; add --engine cvode";
  if (cvode) wrong = formula ? formula_.init(model_) : flight_.init(model_);
  if (wrong.empty()) wrong = read_script();
  if (!wrong.empty()) return wrong;
  step_us_ = static_cast<int64_t>(model_.m->opt.timestep * 1e6 + 0.5);

  const uint64_t asked = o_.scenario.empty() ? series_.robot_digest : scenario_.robot_digest;
  if (model_.robot_digest && asked && model_.robot_digest != asked) {
    return "scene and script are of different robots (digests differ); write both again with `engram task` and `engram demo`";
  }
  const uint64_t digest = o_.robot_digest ? o_.robot_digest : model_.robot_digest ? model_.robot_digest : asked;
  wrong = faults_.init(o_.faults, model_);
  if (wrong.empty() && !o_.log.empty()) wrong = log_.open(o_.log.c_str(), static_cast<int64_t>(o_.log_full * 1e6), o_.log_every);
  if (wrong.empty() && !o_.timing.empty()) {
    timing_ = std::fopen(o_.timing.c_str(), "w");
    if (!timing_) wrong = "cannot write '" + o_.timing + "'";
  }
  if (wrong.empty()) wrong = link_.open(o_.url.c_str(), digest, model_.nu, &log_, timing_);
  state_.robot_digest = static_cast<int64_t>(digest);
  state_.nq = model_.nq, state_.nv = model_.nv;
  task_.task_digest = static_cast<int64_t>(o_.scenario.empty() ? series_.task_digest : scenario_.task_digest);
  return wrong;
}

std::string Plant::read_script() {
  if (!o_.scenario.empty()) {
    script_ = &referee_;
    if (!model_.free_base) return "a scenario needs a robot with a free base";
    return scenario_.read(o_.scenario.c_str(), model_);
  }
  if (o_.series.empty()) return "";
  script_ = &judge_;
  const std::string wrong = series_.read(o_.series.c_str(), model_.nq, model_.nv);
  return wrong.empty() ? model_.select_hand(series_.hand.c_str()) : wrong;
}

bool Plant::finished() const {
  if (o_.duration > 0 && t_ > o_.duration) return true;
  return script_ && script_->finished();
}

// Publishes what the controller shall know about time t, then finds out about time t itself.
void Plant::begin_step() {
  Script::Event event;
  if (script_) event = script_->begin_step(t_);
  if (event.reset) {
    const double rest[kMaxDof] = {};
    state_.seq = 0;
    faults_.restart();
    mj_resetData(model_.m, model_.d);
    model_.set_state(event.reset->data(), rest);
  }
  if (event.pushes) {
    for (const Push& push : *event.pushes) faults_.add(push, t_);
  }
  if (event.task) {
    task_.utime = utime_;
    ++task_.seq;
    task_.jump = event.jump;
    task_.n = static_cast<int32_t>(event.task->size());
    std::copy(event.task->begin(), event.task->end(), task_.value);
    link_.publish_task(task_);
    log_.add(utime_, EventLog::kTask, kTaskChannel, link_.task_bytes(), link_.task_size());
  }
  state_.utime = utime_;
  ++state_.seq, ++steps_;
  model_.get_state(state_.q, state_.v);
  faults_.measure(model_, state_.q, state_.v);
  link_.publish_state(state_);

  mj_step1(model_.m, model_.d);
  if (log_.keeps(utime_, state_.seq)) log_.add(utime_, EventLog::kState, kStateChannel, link_.state_bytes(), link_.state_size());
  log_.flush(utime_);
  const std::string ended = script_ ? script_->look(model_, t_) : "";
  if (!ended.empty()) {
    std::printf("%s\n", ended.c_str());
    std::fflush(stdout);
  }
}

// tau = -D v of the driven joints
void Plant::brake(double* tau) const {
  for (int i = 0; i < model_.nu; ++i) tau[i] = -o_.damping * model_.d->qvel[model_.nv - model_.nu + i];
}

// Waits for the command that answers the current state; says what to do if none comes.
bool Plant::wait_for_command() {
  for (double waited = 0; !stopped && !link_.wait_answer(o_.resend_ms); link_.resend()) {
    waited += 1e-3 * o_.resend_ms;
    if (waited >= o_.give_up) {
      std::fprintf(stderr,
                   "engram-plant: no command on ENGRAM_COMMAND for %.1f s at t = %.3f s (%lld messages refused); start "
                   "engram-controller with --lcm-url '%s', or see its last message\n",
                   waited, t_, static_cast<long long>(link_.refused().total()), o_.url.c_str());
      return false;
    }
  }
  return true;
}

// Takes the command and moves the world by one step. On the wall clock, too, the first command is waited for.
ExitCode Plant::answer_step() {
  double tau[kMaxDof] = {};
  if (lock_step_ || steps_ == 1) {
    if (!wait_for_command()) return kNoController;
    std::memcpy(tau, link_.command().tau, sizeof tau);
  } else {
    link_.drain();
    if (steps_ % kTaskRepeat == 0) link_.resend_task();
    const int64_t age = utime_ - link_.command().utime;
    if (link_.command().seq > 0 && age <= static_cast<int64_t>(1e3 * o_.stale_ms)) {
      std::memcpy(tau, link_.command().tau, sizeof tau);
    } else {
      if (stale_steps_++ == 0) {
        std::fprintf(stderr, "engram-plant: no fresh command at t = %.3f s: joints are braked until one comes (said once)\n", t_);
      }
      brake(tau);
    }
  }
  model_.set_tau(faults_.delay(model_, tau));
  if (script_) script_->command(model_.torque_share(), link_.command().status);
  faults_.push(&model_, t_);
  if (o_.engine == "cvode") {
    const std::string wrong = formula_.ready() ? formula_.step(&model_) : flight_.step(&model_);
    if (!wrong.empty()) {
      std::fprintf(stderr, "engram-plant: %s at t = %.3f s; the last commands in the log tell why\n", wrong.c_str(), t_);
      return kDiverged;
    }
  } else {
    mj_step2(model_.m, model_.d);
  }
  for (const int warning : {mjWARN_BADQPOS, mjWARN_BADQVEL, mjWARN_BADQACC, mjWARN_BADCTRL}) {
    if (model_.d->warning[warning].number > 0) {  // MuJoCo has reset the robot, or let go of it
      std::fprintf(stderr, "engram-plant: the simulation diverged at t = %.3f s; the last commands in the log tell why\n", t_);
      return kDiverged;
    }
  }
  utime_ += step_us_;
  t_ = 1e-6 * static_cast<double>(utime_);
  return kOk;
}

ExitCode Plant::run() {
  using Clock = std::chrono::steady_clock;
  const auto start = Clock::now();
  timespec next{};
  ExitCode code = kOk;
  while (code == kOk && !stopped && !finished()) {
    begin_step();
    if (steps_ == 2) clock_gettime(CLOCK_MONOTONIC, &next);
    if (!lock_step_ && steps_ > 1) {  // the command that arrives within this step acts on it
      next.tv_nsec += 1000 * step_us_;
      next.tv_sec += next.tv_nsec / 1000000000;
      next.tv_nsec %= 1000000000;
      clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &next, nullptr);
    }
    code = answer_step();
  }
  log_.close();
  const std::string wrong = write_results(std::chrono::duration<double>(Clock::now() - start).count());
  if (!wrong.empty()) std::fprintf(stderr, "engram-plant: %s\n", wrong.c_str());
  if (code != kOk) return code;
  if (stopped) return kStopped;
  if (log_.truncated() || !wrong.empty()) return kLogTruncated;
  return kOk;
}

std::string Plant::write_results(double wall_seconds) const {
  if (o_.results.empty()) return "";
  std::FILE* file = std::fopen(o_.results.c_str(), "w");
  if (!file) return "cannot write '" + o_.results + "'";
  const Refused& refused = link_.refused();
  std::fprintf(file, "{\n  \"clock\": \"%s\",\n  \"steps\": %lld,\n  \"sim_seconds\": %.3f,\n  \"wall_seconds\": %.3f,\n",
               o_.clock.c_str(), static_cast<long long>(steps_), t_, wall_seconds);
  std::fprintf(file, "  \"robot_digest\": \"0x%016llx\",\n  \"task_digest\": \"0x%016llx\",\n",
               static_cast<unsigned long long>(state_.robot_digest), static_cast<unsigned long long>(task_.task_digest));
  std::fprintf(file, "  \"log\": {\"events\": %lld, \"bytes\": %lld, \"truncated\": %s},\n",
               static_cast<long long>(log_.events()), static_cast<long long>(log_.bytes()), log_.truncated() ? "true" : "false");
  std::fprintf(file,
               "  \"refused\": {\"malformed\": %lld, \"foreign_robot\": %lld, \"not_finite\": %lld, \"second_answer\": %lld},\n"
               "  \"resends\": %lld,\n  \"stale_steps\": %lld,\n  ",
               static_cast<long long>(refused.malformed), static_cast<long long>(refused.foreign_robot),
               static_cast<long long>(refused.not_finite), static_cast<long long>(refused.second_answer),
               static_cast<long long>(link_.resends()), static_cast<long long>(stale_steps_));
  if (script_) script_->write(file);
  else std::fprintf(file, "\"jumps\": []");
  std::fprintf(file, "\n}\n");
  const bool failed = std::ferror(file) != 0;
  return std::fclose(file) != 0 || failed ? "cannot write '" + o_.results + "': the disk is full" : "";
}

int plant_main(int argc, char** argv) {
  install_mujoco_handlers("engram-plant");
  std::signal(SIGINT, [](int) { stopped = 1; });
  std::signal(SIGTERM, [](int) { stopped = 1; });
  Plant plant(read_options(argc, argv));
  const std::string wrong = plant.init();
  if (!wrong.empty()) {
    std::fprintf(stderr, "engram-plant: %s\n", wrong.c_str());
    return kBadInput;
  }
  return plant.run();
}

}  // namespace
}  // namespace engram::sim

int main(int argc, char** argv) { return engram::sim::plant_main(argc, argv); }
