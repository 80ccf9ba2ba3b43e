#include "controller/io/io_settings.h"

#include <getopt.h>

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>

#include "controller/io/io_exit.h"
#include "controller/io/io_realtime.h"

namespace engram::io {
namespace {

constexpr const char* kModes[ENGRAM_MODE_COUNT] = {"memory", "line", "shift", "cold"};
constexpr double kWallBudgetUs = 6000;  // leaves the feedback and the system a share of the 10 ms period

// "panda_reach"
std::string name_of(const engram_model* model) {
  return std::string(engram_describe(model)->robot) + "_" + engram_describe(model)->task;
}

std::string names_of(const Models& models) {
  std::string names;
  for (const engram_model* model : models) names += " " + name_of(model);
  return names;
}

void print_help(const Settings& s, const Models& models) {
  std::printf(
      "engram-controller: steers a robot by model predictive control with a memory of motion, over LCM.\n"
      "\n"
      "It answers every ENGRAM_STATE with an ENGRAM_COMMAND, takes its target from ENGRAM_TASK, and publishes what it did on\n"
      "ENGRAM_CYCLE and ENGRAM_TIMING. It holds the robot where it stands until the first task arrives.\n"
      "\n"
      "  --model ROBOT_TASK          what to control (%s); this binary holds:%s\n"
      "  --lcm-url URL               LCM provider (%s)\n"
      "  --clock lockstep|wall       lockstep: one thread, iterations counted, reproducible to the bit (default).\n"
      "                              wall: commands at once on one thread, plans on another, iterations limited by time\n"
      "  --memory MODE               what may seed the solver:\n"
      "                                memory  remembered motions, regression, straight lines, the shifted plan (default)\n"
      "                                line    straight lines and the shifted plan\n"
      "                                shift   the shifted plan only\n"
      "                                cold    at a jump stand still, else the shifted plan\n"
      "  --iterations N              FDDP iterations per period (%d)\n"
      "  --iterations-jump N         FDDP iterations in the period after a jump, from each start (%d)\n"
      "  --starts N                  guesses with different final postures that are iterated after a jump (%d)\n"
      "  --budget US                 CPU time per period after which no iteration begins; 0: none (lockstep 0, wall %.0f)\n"
      "  --delay US                  known time from a state to the effect of the command that answers it (0)\n"
      "  --timing FILE               write the CPU time of every cycle by phase, as CSV\n"
      "  --jumps FILE                write every jump's start, target, and merit after each iteration, as CSV\n"
      "  --realtime                  lock memory and ask for SCHED_FIFO\n"
      "  --version, --help\n"
      "\n"
      "Ends on SIGINT or SIGTERM with a summary. Exit codes: 0 ended as asked, %d wrong usage, %d no network,\n"
      "%d another controller serves the robot already.\n",
      name_of(s.model).c_str(), names_of(models).c_str(), s.lcm_url, s.options.iterations, s.options.iterations_jump,
      s.options.starts, kWallBudgetUs, kExitUsage, kExitNetwork, kExitTaken);
}

int wrong(const char* format, const char* what) {
  std::fputs("engram-controller: ", stderr);
  std::fprintf(stderr, format, what);
  std::fputs("; see --help\n", stderr);
  return kExitUsage;
}

bool read_number(const char* text, double* value) {
  char* end;
  *value = std::strtod(text, &end);
  return end != text && *end == '\0';
}

bool read_count(const char* text, int32_t* value) {
  double number;
  if (!read_number(text, &number) || number < 0 || number > 1e6 || number != static_cast<int32_t>(number)) return false;
  *value = static_cast<int32_t>(number);
  return true;
}

}  // namespace

bool read_settings(int argc, char** argv, const Models& models, Settings* s, int* exit_code) {
  enum {
    kModel = 1,
    kUrl,
    kClock,
    kMemory,
    kIterations,
    kIterationsJump,
    kStarts,
    kBudget,
    kDelay,
    kTiming,
    kJumps,
    kRealtime,
    kVersion,
    kHelp
  };
  static const option kOptions[] = {{"model", required_argument, nullptr, kModel},
                                    {"lcm-url", required_argument, nullptr, kUrl},
                                    {"clock", required_argument, nullptr, kClock},
                                    {"memory", required_argument, nullptr, kMemory},
                                    {"iterations", required_argument, nullptr, kIterations},
                                    {"iterations-jump", required_argument, nullptr, kIterationsJump},
                                    {"starts", required_argument, nullptr, kStarts},
                                    {"budget", required_argument, nullptr, kBudget},
                                    {"delay", required_argument, nullptr, kDelay},
                                    {"timing", required_argument, nullptr, kTiming},
                                    {"jumps", required_argument, nullptr, kJumps},
                                    {"realtime", no_argument, nullptr, kRealtime},
                                    {"version", no_argument, nullptr, kVersion},
                                    {"help", no_argument, nullptr, kHelp},
                                    {nullptr, 0, nullptr, 0}};
  *exit_code = kExitUsage;
  opterr = 0;
  s->model = *models.begin();
  // Defaults depend on the model: find it first.
  for (int c; (c = getopt_long(argc, argv, "", kOptions, nullptr)) != -1;) {
    if (c != kModel) continue;
    s->model = nullptr;
    for (const engram_model* model : models)
      if (name_of(model) == optarg) s->model = model;
    if (s->model != nullptr) continue;
    std::fprintf(stderr, "engram-controller: --model %s: this binary holds no such model, but:%s\n", optarg, names_of(models).c_str());
    return false;
  }
  optind = 1;
  engram_default_options(s->model, &s->options);
  s->options.clock = thread_cpu_us;
  bool budget_given = false;
  for (int c; (c = getopt_long(argc, argv, "", kOptions, nullptr)) != -1;) {
    switch (c) {
      case kModel:
        break;
      case kUrl:
        s->lcm_url = optarg;
        break;
      case kTiming:
        s->timing = optarg;
        break;
      case kJumps:
        s->jumps = optarg;
        break;
      case kRealtime:
        s->realtime = true;
        break;
      case kClock:
        if (std::strcmp(optarg, "lockstep") == 0) s->clock = Clock::kLockstep;
        else if (std::strcmp(optarg, "wall") == 0) s->clock = Clock::kWall;
        else return *exit_code = wrong("--clock %s: must be lockstep or wall", optarg), false;
        break;
      case kMemory: {
        int mode = 0;
        while (mode < ENGRAM_MODE_COUNT && std::strcmp(optarg, kModes[mode]) != 0) ++mode;
        if (mode == ENGRAM_MODE_COUNT)
          return *exit_code = wrong("--memory %s: must be memory, line, shift or cold", optarg), false;
        s->options.memory = static_cast<engram_mode>(mode);
        break;
      }
      case kIterations:
        if (!read_count(optarg, &s->options.iterations)) return *exit_code = wrong("--iterations %s: not a count", optarg), false;
        break;
      case kIterationsJump:
        if (!read_count(optarg, &s->options.iterations_jump))
          return *exit_code = wrong("--iterations-jump %s: not a count", optarg), false;
        break;
      case kStarts:
        if (!read_count(optarg, &s->options.starts)) return *exit_code = wrong("--starts %s: not a count", optarg), false;
        break;
      case kBudget:
        if (!read_number(optarg, &s->options.budget_us)) return *exit_code = wrong("--budget %s: not a number", optarg), false;
        budget_given = true;
        break;
      case kDelay: {
        int32_t us = 0;
        if (!read_count(optarg, &us)) return *exit_code = wrong("--delay %s: not a count of us", optarg), false;
        s->options.delay_us = us;
        break;
      }
      case kVersion:
        return std::printf("engram-controller %s\n", engram_version()), *exit_code = 0, false;
      case kHelp:
        return print_help(*s, models), *exit_code = 0, false;
      default:
        return *exit_code = wrong("unknown option or missing value: %s", argv[optind - 1]), false;
    }
  }
  if (optind < argc) return *exit_code = wrong("unexpected argument: %s", argv[optind]), false;
  if (s->clock == Clock::kWall && !budget_given) s->options.budget_us = kWallBudgetUs;
  return true;
}

}  // namespace engram::io
