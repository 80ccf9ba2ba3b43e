// Talos walks at a commanded velocity, or stands, with a memory of steps.
#include "controller/loop/loop_controller.h"
#include "controller/loop/loop_receding.h"
#include "controller/loop/loop_talos_walk.h"
#include "tables/talos_step/tables.h"

namespace {
constexpr engram::StepTables kTables = {&talos_step_regression_v1, &talos_step_path_v1, &talos_step_torque_v1};
}

using Model = engram::LeggedModel<engram::TalosWalkRemembers<kTables>>;

extern "C" constexpr engram_model engram_talos_walk = engram::loop_model<Model, engram::RecedingPlanner<Model>>("talos", "walk");
