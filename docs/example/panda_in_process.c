// Steers the Panda in process: Engram's C API on one side, MuJoCo as the robot on the other, no messages in between.
//   panda_in_process tables/panda_reach/scene.xml        prints how far the hand is from its target; exit code 0: it arrived
#include <math.h>
#include <mujoco/mujoco.h>
#include <stdint.h>
#include <stdio.h>

#include "controller/engram.h"

static unsigned char memory[2000000];  // the controller lives here; engram_sizeof says how much it needs

int main(int argc, char** argv) {
  const double target[7] = {0.32, -0.20, 0.50, 1, 0, 0, 0};  // hand position (m) and quaternion x y z w, world axes
  char error[1000] = "name the scene: tables/panda_reach/scene.xml";
  mjModel* m = argc == 2 ? mj_loadXML(argv[1], NULL, error, sizeof error) : NULL;
  if (!m) return fprintf(stderr, "%s\n", error), 2;
  mjData* d = mj_makeData(m);
  const double posture[7] = {0, -0.8, 0, -2.3, 0, 1.6, 0.8};
  for (int i = 0; i < 7; ++i) d->qpos[i] = posture[i];

  engram_controller* arm;
  const engram_error wrong = engram_init(&engram_panda_reach, memory, sizeof memory, NULL, &arm);
  if (wrong) return fprintf(stderr, "%s\n", engram_error_text(wrong)), 2;
  const int64_t tick = engram_describe(&engram_panda_reach)->tick_us, step = (int64_t)(1e6 * m->opt.timestep + 0.5);

  engram_cycle cycle;
  double off = INFINITY;
  engram_set_task(arm, 0, 1, target, 7);
  for (int64_t t = 0; t <= 3000000; t += step) {
    const int is_tick = t % tick == 0;
    if (is_tick) engram_feedback(arm, t, d->qpos, d->qvel);
    engram_command(arm, t, d->qpos, d->qvel, d->ctrl);
    mj_step(m, d);
    if (is_tick) engram_prepare(arm, t + tick);
    if (t % 250000 == 0 && t > 0) {
      engram_cycle_info(arm, &cycle);
      off = hypot(hypot(cycle.path[0][0] - target[0], cycle.path[0][1] - target[1]), cycle.path[0][2] - target[2]);
      printf("%.2f s  hand %.4f m off  cost %.4f  %s, %s\n", 1e-6 * (double)t, off, cycle.cost, engram_rung_text(cycle.rung),
             engram_status_text(cycle.status));
    }
  }
  mj_deleteData(d);
  mj_deleteModel(m);
  return off < 0.01 ? 0 : 1;
}
