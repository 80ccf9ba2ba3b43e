// The unicycle parks at way points.
#include "controller/loop/loop_controller.h"
#include "controller/loop/loop_systems.h"
#include "tables/unicycle_park/task.h"

namespace {
using Model = engram::UnicycleModel<engram::tasks::UnicyclePark>;
}  // namespace

extern "C" constexpr engram_model engram_unicycle_park = engram::loop_model<Model, engram::RecedingPlanner<Model>>("unicycle", "park");
