// Talos walks with a memory of steps. docs/steps.md
#ifndef CONTROLLER_LOOP_LOOP_TALOS_WALK_H_
#define CONTROLLER_LOOP_LOOP_TALOS_WALK_H_

#include "controller/loop/loop_talos.h"
#include "controller/loop/loop_walk_memory.h"
#include "tables/talos_step/task.h"

namespace engram {

template <const StepTables& tables> struct TalosWalkRemembers : TalosWalk {
  using Memory = WalkMemory<P, tasks::TalosStep, TalosMirror, tables>;
};

}  // namespace engram
#endif  // CONTROLLER_LOOP_LOOP_TALOS_WALK_H_
