// The memory of steps in Python: the deployed query, on tables that are still arrays (engram.emit.kinds).
#include "codegen/binding/arrays.h"
#include "codegen/binding/engine_problems.h"
#include "codegen/binding/held_table.h"
#include "codegen/binding/thread_clock.h"
#include "controller/memory/step_memory.h"
#include "tables/talos_step/task.h"

#include <nanobind/stl/optional.h>

#include <algorithm>
#include <memory>
#include <optional>

namespace engram::binding {
namespace {

using Task = tasks::TalosStep;

class StepMemory {
  using R = Task::Robot;
  static constexpr int N = Task::nknots, nx = R::nq + R::nv, nu = R::nu;

 public:
  StepMemory(const nb::object& regression, const nb::object& path, const nb::object& torque)
      : regression_(regression, R::digest, Task::digest),
        path_(path, R::digest, Task::digest),
        torque_(torque, R::digest, Task::digest),
        tables_{regression_.as<TabGpr>(), path_.as<TabPca>(), torque_.as<TabPca>()},
        work_(std::make_unique<StepWork<Task>>()),
        guess_(std::make_unique<StepGuess<Task>>()) {
    char text[TAB_TEXT];
    if (step_check<Task>(tables_, text) != kTabOk) throw nb::value_error(text);
  }

  nb::dict query(const In<2>& feet, const In<1>& goal, int foot, const In<1>& x0, const std::optional<In<1>>& previous,
                 const std::optional<In<1>>& next, int at) {
    const StepTask task = task_of(feet, goal, foot, previous, next);
    ask(task, at < 0 ? step_first<Task>(task) : at, x0);
    nb::dict result = guess();
    result["status"] = tab_status_text(guess_->status);
    return result;
  }

  // The guess of coefficients z that another learner has found.
  nb::dict decode(const In<1>& z, const In<2>& feet, const In<1>& goal, int foot, const In<1>& x0, const std::optional<In<1>>& previous,
                  const std::optional<In<1>>& next) {
    check_shape<1>("z", z, {tables_.regression->m});
    check_shape<1>("x0", x0, {nx});
    const StepTask task = task_of(feet, goal, foot, previous, next);
    std::copy_n(z.data(), z.shape(0), work_->z);
    step_decode<Task, TalosMirror>(tables_, task, step_first<Task>(task), x0.data(), *work_, *guess_);
    return guess();
  }

  static Out features(const In<2>& feet, const In<1>& goal, int foot, const std::optional<In<1>>& previous, const std::optional<In<1>>& next) {
    double x[kStepFeatures];
    step_features(task_of(feet, goal, foot, previous, next), x);
    NewArray out({kStepFeatures});
    std::copy_n(x, kStepFeatures, out.data());
    return out.release();
  }

  // Processor time [us] of each of n queries.
  Out query_us(const In<2>& feet, const In<1>& goal, int foot, const In<1>& x0, int n) {
    const StepTask task = task_of(feet, goal, foot, {}, {});
    NewArray us({std::size_t(n)});
    for (int i = 0; i < n; ++i) us.data()[i] = timed_us([&] { ask(task, 0, x0); });
    return us.release();
  }

 private:
  nb::dict guess() {
    const std::size_t n = guess_->last - guess_->first;
    NewArray xs({n + 1, nx}), us({n, nu});
    std::copy_n(guess_->x[guess_->first], (n + 1) * nx, xs.data());
    std::copy_n(guess_->u[guess_->first], n * nu, us.data());
    nb::dict result;
    result["xs"] = xs.release();
    result["us"] = us.release();
    return result;
  }

  static StepTask task_of(const In<2>& feet, const In<1>& goal, int foot, const std::optional<In<1>>& previous,
                          const std::optional<In<1>>& next) {
    check_shape<2>("feet", feet, {2, 3});
    check_shape<1>("goal", goal, {3});
    if (foot != 0 && foot != 1) throw nb::value_error("foot: expected 0 (left) or 1 (right)");
    StepTask task;
    std::copy_n(feet.data(), 6, task.feet[0]);
    std::copy_n(goal.data(), 3, task.goal);
    task.foot = foot;
    if (previous) {
      check_shape<1>("previous", *previous, {3});
      task.from_walk = true;
      std::copy_n(previous->data(), 3, task.previous);
    }
    if (next) {
      check_shape<1>("next", *next, {3});
      task.into_walk = true;
      std::copy_n(next->data(), 3, task.next);
    }
    return task;
  }

  void ask(const StepTask& task, int at, const In<1>& x0) {
    check_shape<1>("x0", x0, {nx});
    if (!step_query<Task, TalosMirror>(tables_, task, at, x0.data(), *work_, *guess_))
      throw nb::value_error("feet, goal or x0: not finite, or `at` is not a knot of the step");
  }

  HeldTable regression_, path_, torque_;
  StepTables tables_;
  std::unique_ptr<StepWork<Task>> work_;
  std::unique_ptr<StepGuess<Task>> guess_;
};

}  // namespace

void bind_step_memory(nb::module_& engine) {
  using namespace nb::literals;
  nb::class_<StepMemory>(engine, "TalosStepMemory", "The memory of steps on tables of engram.emit.kinds: regression, path and torque bases.")
      .def(nb::init<const nb::object&, const nb::object&, const nb::object&>(), "regression"_a, "path"_a, "torque"_a)
      .def("query", &StepMemory::query, "feet"_a, "goal"_a, "foot"_a, "x0"_a, "previous"_a = nb::none(), "next"_a = nb::none(), "at"_a = -1,
           "A guess xs (T + 1, nx), us (T, nu) of the step of `foot` from feet (2, 3) to goal (3), from x0 at its knot `at` (-1: its first); "
           "status. previous, next: poses (3) of the standing foot before and after, within a walk.")
      .def("decode", &StepMemory::decode, "z"_a, "feet"_a, "goal"_a, "foot"_a, "x0"_a, "previous"_a = nb::none(), "next"_a = nb::none(),
           "The guess xs, us of coefficients z (m) of another learner.")
      .def_static("features", &StepMemory::features, "feet"_a, "goal"_a, "foot"_a, "previous"_a = nb::none(), "next"_a = nb::none(),
                  "What the regression sees of a step (15).")
      .def("query_us", &StepMemory::query_us, "feet"_a, "goal"_a, "foot"_a, "x0"_a, "n"_a, "Processor times [us] of n queries.");
  nb::list other, sign;
  for (int i = 0; i < TalosMirror::nu; ++i) {
    other.append(TalosMirror::other[i]);
    sign.append(TalosMirror::sign[i]);
  }
  engine.attr("TALOS_MIRROR") = nb::make_tuple(other, sign);
}

}  // namespace engram::binding
