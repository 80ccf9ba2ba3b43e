// The door itself: checks the arguments, sets the floating-point mode, and goes through the model.
#include "controller/engram.h"

#include "controller/loop/loop_door.h"
#include "controller/loop/loop_fpu.h"

#include <cmath>
#include <cstring>

using engram::FlushSubnormals;

namespace {

bool within(double value, double lo, double hi) { return value >= lo && value <= hi; }  // false for NaN

engram_error check(const engram_model& model, const engram_options& o) {
  constexpr double kSecond = 1e6;
  const double tick = static_cast<double>(model.about.tick_us);
  if (o.memory < 0 || o.memory >= ENGRAM_MODE_COUNT) return ENGRAM_ERROR_MODE;
  if (!within(o.iterations, 1, ENGRAM_JUMP_ITERATIONS) || !within(o.iterations_jump, 1, ENGRAM_JUMP_ITERATIONS) ||
      !within(o.line_search, 1, 10) || !within(o.starts, 1, 8)) {
    return ENGRAM_ERROR_ITERATIONS;
  }
  if (!within(o.budget_us, 0, kSecond) || (o.budget_us > 0 && o.clock == nullptr)) return ENGRAM_ERROR_BUDGET;
  if (!within(o.torque_rate, 1e-3, 1e9) || !within(o.clearance_min, -1, 1) || !within(o.switch_gain, 0, 1) ||
      !within(o.hold_rate, 1, 100)) {
    return ENGRAM_ERROR_LIMITS;
  }
  const double gap = static_cast<double>(o.state_gap_us), age = static_cast<double>(o.plan_age_us);
  if (!within(gap, tick, 100 * kSecond) || !within(age, tick, 100 * kSecond) ||
      !within(static_cast<double>(o.off_after_us), gap, 100 * kSecond)) {
    return ENGRAM_ERROR_WATCHDOG;
  }
  if (!within(static_cast<double>(o.delay_us), 0, ENGRAM_DELAY_MAX_US)) return ENGRAM_ERROR_DELAY;
  return ENGRAM_NO_ERROR;
}

template <class E> const char* text_of(const char* const* texts, int count, E value, const char* unknown) {
  return value >= 0 && value < count ? texts[value] : unknown;
}
template <int n> constexpr int size_of(const char* const (&)[n]) { return n; }

constexpr const char* kErrors[] = {
    "no error",
    "an argument is NULL: pass model, memory and handle",
    "the memory block is too small: it must have engram_sizeof(model) bytes",
    "options.memory is not an engram_mode: start from engram_default_options",
    "options.iterations and iterations_jump must be 1 to 50, starts 1 to 8, line_search 1 to 10",
    "options.budget_us must be 0 to 1e6 us, and a budget needs options.clock",
    "options.torque_rate must be positive, clearance_min within 1 m, switch_gain 0 to 1, hold_rate 1 to 100 rad/s",
    "options.state_gap_us and plan_age_us must be at least one tick, off_after_us at least state_gap_us, all at most 100 s",
    "options.delay_us must be 0 to 50000 us",
    "the memory's tables do not belong to this robot and task: run 'make tables' and build again",
};
constexpr const char* kStatuses[] = {
    "converged",  "iterating", "deadline",  "no descent",  "not positive definite",
    "not finite", "collision", "open gaps", "too fast",    "no task",
    "bad task",   "task far",  "bad state", "stale state", "stale plan",
};
constexpr const char* kRungs[] = {"plan", "shifted", "hold", "damping", "off"};
constexpr const char* kCandidates[] = {"shifted", "knn", "gpr", "gmr", "line", "cold", "tt", "mlp"};
static_assert(size_of(kErrors) == ENGRAM_ERROR_TABLES + 1, "a text for every error");
static_assert(size_of(kStatuses) == ENGRAM_STATUS_COUNT && size_of(kRungs) == ENGRAM_RUNG_COUNT &&
                  size_of(kCandidates) == ENGRAM_CANDIDATE_COUNT,
              "a text for every value");

}  // namespace

const char* engram_version(void) { return ENGRAM_VERSION; }
const engram_description* engram_describe(const engram_model* model) { return &model->about; }
uint64_t engram_table_digest(const engram_model* model) { return model->table_digest(); }
const char* engram_error_text(engram_error error) { return text_of(kErrors, size_of(kErrors), error, "unknown error"); }
const char* engram_status_text(engram_status status) { return text_of(kStatuses, size_of(kStatuses), status, "unknown status"); }
const char* engram_rung_text(engram_rung rung) { return text_of(kRungs, size_of(kRungs), rung, "unknown rung"); }
const char* engram_candidate_text(engram_candidate c) {
  return text_of(kCandidates, size_of(kCandidates), c, "unknown candidate");
}

void engram_default_options(const engram_model* model, engram_options* options) {
  *options = engram_options{};
  options->memory = ENGRAM_MODE_MEMORY;
  options->iterations = model->iterations;
  options->iterations_jump = 10;
  options->starts = 3;
  options->line_search = 8;
  options->torque_rate = 1000.0;
  options->clearance_min = 0.005;
  options->switch_gain = 0.1;
  options->hold_rate = 10.0;
  options->state_gap_us = 3 * model->about.tick_us;
  options->plan_age_us = 10 * model->about.tick_us;
  options->off_after_us = 50 * model->about.tick_us;
}

size_t engram_sizeof(const engram_model* model) { return model->bytes + ENGRAM_ALIGN - 1; }

engram_error engram_init(const engram_model* model, void* memory, size_t bytes, const engram_options* options,
                         engram_controller** handle) {
  if (handle == nullptr) return ENGRAM_ERROR_NULL;
  *handle = nullptr;
  if (model == nullptr || memory == nullptr) return ENGRAM_ERROR_NULL;
  if (bytes < engram_sizeof(model)) return ENGRAM_ERROR_MEMORY;
  engram_options chosen;
  engram_default_options(model, &chosen);
  if (options != nullptr) chosen = *options;
  const engram_error error = check(*model, chosen);
  if (error != ENGRAM_NO_ERROR) return error;
  if (!model->tables_fit()) return ENGRAM_ERROR_TABLES;
  const uintptr_t at = (reinterpret_cast<uintptr_t>(memory) + ENGRAM_ALIGN - 1) / ENGRAM_ALIGN * ENGRAM_ALIGN;
  std::memset(reinterpret_cast<void*>(at), 0, model->bytes);  // touches every page
  *handle = model->build(model, chosen, reinterpret_cast<void*>(at));
  return ENGRAM_NO_ERROR;
}

void engram_reset(engram_controller* handle) {
  const engram_model* const model = handle->model;
  const engram_options options = handle->options;
  model->build(model, options, handle);
}

const engram_model* engram_model_of(const engram_controller* handle) { return handle->model; }

engram_status engram_set_task(engram_controller* handle, int64_t utime, int32_t jump, const double* value, int32_t n) {
  const FlushSubnormals flush;
  return handle->model->set_task(handle, utime, jump, value, n);
}

engram_status engram_prepare(engram_controller* handle, int64_t utime) {
  const FlushSubnormals flush;
  return handle->model->prepare(handle, utime);
}

engram_status engram_feedback(engram_controller* handle, int64_t utime, const double* q, const double* v) {
  const FlushSubnormals flush;
  return handle->model->feedback(handle, utime, q, v);
}

engram_status engram_command(engram_controller* handle, int64_t utime, const double* q, const double* v, double* tau) {
  const FlushSubnormals flush;
  return handle->model->command(handle, utime, q, v, tau);
}

int32_t engram_choose_goal(engram_controller* handle, const double* q, const double* v, const double* goals, int32_t n, double* merit) {
  const FlushSubnormals flush;
  for (int32_t g = 0; g < n; ++g) merit[g] = HUGE_VAL;
  return handle->model->choose_goal != nullptr ? handle->model->choose_goal(handle, q, v, goals, n, merit) : -1;
}

void engram_cycle_info(const engram_controller* handle, engram_cycle* cycle) { *cycle = handle->model->cycle(handle); }
void engram_jump_info(const engram_controller* handle, engram_jump* jump) { *jump = handle->model->jump(handle); }

int32_t engram_plan(const engram_controller* handle, int64_t* utime, double* x, double* u, double* K) {
  return handle->model->plan(handle, utime, x, u, K);
}
