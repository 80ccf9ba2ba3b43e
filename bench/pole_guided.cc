// The model of engram_talos_pole without its memory: what the memory learns from must not depend on it.
#include "bench/pole_guided.h"
#include "controller/loop/loop_controller.h"
#include "controller/loop/loop_receding.h"
#include "controller/loop/loop_talos_pole.h"

using Model = engram::LeggedModel<engram::TalosPole>;

extern "C" constexpr engram_model engram_talos_pole_guided = engram::loop_model<Model, engram::RecedingPlanner<Model>>("talos", "pole");
