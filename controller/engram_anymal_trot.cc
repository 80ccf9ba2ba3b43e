// ANYmal trots at a commanded velocity, or stands.
#include "controller/loop/loop_anymal.h"
#include "controller/loop/loop_controller.h"
#include "controller/loop/loop_receding.h"

using Model = engram::LeggedModel<engram::AnymalTrot>;

extern "C" constexpr engram_model engram_anymal_trot = engram::loop_model<Model, engram::RecedingPlanner<Model>>("anymal", "trot");
