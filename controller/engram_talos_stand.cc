// Talos stands: height and squats of its centre of mass over feet that stay. Takes pushes without a step.
#include "controller/loop/loop_controller.h"
#include "controller/loop/loop_legged.h"
#include "controller/loop/loop_receding.h"
#include "controller/loop/loop_talos.h"
#include "tables/talos_stand/task.h"

namespace {

using namespace engram;

struct Standing {
  static constexpr int nfeet = 2, nphases = 1, lead = 1;
  static constexpr GaitPhase phase[nphases] = {{0u, 1}};
  static constexpr double slot = tasks::TalosStand::dt, swing_height = 0.0;
};

struct TalosStand : TalosBody<tasks::TalosStand, 50> {
  using Gait = Standing;
  static void command(const double* task, LeggedCommand& c) {
    c.height = task[0];
    c.depth = task[1];
    c.rate = task[2];
  }
};
using Model = LeggedModel<TalosStand>;

}  // namespace

extern "C" constexpr engram_model engram_talos_stand = loop_model<Model, RecedingPlanner<Model>>("talos", "stand");
