// The Panda that reaches: robot, task and memory bound into one model.
#include "controller/loop/loop_controller.h"
#include "controller/loop/loop_planner.h"
#include "controller/loop/loop_reach.h"
#include "controller/loop/loop_reach_memory.h"
#include "tables/panda_reach/tables.h"
#include "tables/panda_reach/task.h"

namespace {
using Task = engram::tasks::PandaReach;
constexpr engram::MemoryTables kTables = PANDA_REACH_MEMORY;
using Model = engram::ReachModel<Task, engram::ReachMemory<Task, kTables>>;
}  // namespace

extern "C" constexpr engram_model engram_panda_reach = engram::loop_model<Model, engram::Planner<Model>>("panda", "reach");
