// Talos stands, and its right hand follows a target around a pole, with a memory of the way.
#include "controller/loop/loop_controller.h"
#include "controller/loop/loop_receding.h"
#include "controller/loop/loop_talos_pole.h"
#include "tables/talos_pole/tables.h"

namespace {
constexpr engram::PoleTables kTables = {&talos_pole_knn_v1, &talos_pole_path_v1};
}

using Model = engram::LeggedModel<engram::TalosPoleRemembers<kTables>>;

extern "C" constexpr engram_model engram_talos_pole = engram::loop_model<Model, engram::RecedingPlanner<Model>>("talos", "pole");
