// Talos walks at a commanded velocity, or stands.
#include "controller/loop/loop_controller.h"
#include "controller/loop/loop_receding.h"
#include "controller/loop/loop_talos.h"

using Model = engram::LeggedModel<engram::TalosWalk>;

extern "C" constexpr engram_model engram_talos_walk = engram::loop_model<Model, engram::RecedingPlanner<Model>>("talos", "walk");
