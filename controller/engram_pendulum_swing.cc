// The pendulum swings up and stays there.
#include "controller/loop/loop_controller.h"
#include "controller/loop/loop_systems.h"
#include "tables/pendulum_swing/task.h"

namespace {
using Model = engram::PendulumModel<engram::tasks::PendulumSwing>;
}  // namespace

extern "C" constexpr engram_model engram_pendulum_swing = engram::loop_model<Model, engram::RecedingPlanner<Model>>("pendulum", "swing");
