// The Panda that reaches: robot, task and memory bound into one model.
#include "controller/loop/loop_controller.h"
#include "controller/loop/loop_reach.h"
#include "tables/panda_reach/task.h"

namespace {
using Model = engram::ReachModel<engram::tasks::PandaReach, engram::NoReachMemory<engram::tasks::PandaReach>>;
}

extern "C" constexpr engram_model engram_panda_reach = engram::loop_model<Model>("panda", "reach");
