// Talos stands, squats, and takes pushes without a step.
#include "controller/loop/loop_controller.h"
#include "controller/loop/loop_receding.h"
#include "controller/loop/loop_talos.h"

using Model = engram::LeggedModel<engram::TalosStand>;

extern "C" constexpr engram_model engram_talos_stand = engram::loop_model<Model, engram::RecedingPlanner<Model>>("talos", "stand");
