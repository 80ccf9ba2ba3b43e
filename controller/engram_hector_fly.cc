// Hector flies: to way points, and hovers there against the wind.
#include "controller/loop/loop_controller.h"
#include "controller/loop/loop_flight.h"
#include "tables/hector_fly/task.h"

namespace {
using Model = engram::FlightModel<engram::tasks::HectorFly>;
}  // namespace

extern "C" constexpr engram_model engram_hector_fly = engram::loop_model<Model, engram::RecedingPlanner<Model>>("hector", "fly");
