// The bicopter flies to way points, and hovers there against the wind.
#include "controller/loop/loop_controller.h"
#include "controller/loop/loop_systems.h"
#include "tables/bicopter_fly/task.h"

namespace {
using Model = engram::BicopterModel<engram::tasks::BicopterFly>;
}  // namespace

extern "C" constexpr engram_model engram_bicopter_fly = engram::loop_model<Model, engram::RecedingPlanner<Model>>("bicopter", "fly");
