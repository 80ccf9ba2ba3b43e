// The memory of steps in a walk under way: how a plan goes on through the steps that its gait has ahead.
//
//   walk_step   the step (step_memory.h) that a slot of the gait belongs to, and which of its knots the slot is
//   WalkMemory  the plan goes on from its last state as the memory has the step that comes, with the footholds as they are now planned
//
// A step outside what was learnt (kTabOutside), or a slot that belongs to none, gives no guess: the shifted plan goes on alone.
#ifndef CONTROLLER_LOOP_LOOP_WALK_MEMORY_H_
#define CONTROLLER_LOOP_LOOP_WALK_MEMORY_H_

#include "controller/loop/loop_gait.h"
#include "controller/loop/loop_plan.h"
#include "controller/memory/step_memory.h"

#include <algorithm>

namespace engram {

// False: both feet rest then, or the step began before the window. Two feet that swing in turn; ground: their height [m].
template <class Task, class G> bool walk_step(const Gait<G>& gait, int64_t slot, double ground, StepTask& step, int& knot) {
  static_assert(G::nfeet == 2, "one foot stands while the other swings");
  constexpr int kBefore = static_cast<int>(Task::gait_before), kBetween = static_cast<int>(Task::gait_between);
  const typename Gait<G>::Phase* swing[Gait<G>::kPhases + 1];
  int n = 0, i = -1;
  const bool walked = gait.swung().slots > 0;
  if (walked) swing[n++] = &gait.swung();
  for (int p = 0; p < gait.phases(); ++p)
    if (gait.phase(p).swing != 0) swing[n++] = &gait.phase(p);
  while (i + 1 < n && slot >= swing[i + 1]->first - (i + 1 > 0 ? kBetween / 2 : kBefore)) ++i;
  if (i < (walked ? 1 : 0)) return false;

  const auto put = [](const Placement& from, double* to) {
    for (int axis = 0; axis < 2; ++axis) to[axis] = from.p[axis];
    to[2] = from.yaw;
  };
  const auto& now = *swing[i];
  step = {};
  step.ground = ground;
  step.foot = now.swing == 1u ? 0 : 1;
  const int stands = 1 - step.foot;
  for (int f = 0; f < 2; ++f) put(now.from[f], step.feet[f]);
  put(now.to[step.foot], step.goal);
  step.from_walk = i > 0;
  step.into_walk = i + 1 < n;
  if (step.from_walk) put(swing[i - 1]->from[stands], step.previous);
  if (step.into_walk) put(swing[i + 1]->to[stands], step.next);
  knot = static_cast<int>(slot - now.first) + kBefore;
  return knot >= step_first<Task>(step) && knot < step_last<Task>(step);
}

// Task: of the steps; Mirror: as step_memory.h has it.
template <class P, class Task, class Mirror, const StepTables& tables> class WalkMemory {
 public:
  static constexpr bool kRemembers = false, kContinues = true;

  static bool tables_fit() {
    char text[TAB_TEXT];
    return step_check<Task>(tables, text) == kTabOk;
  }
  static uint64_t table_digest() {
    return (tables.regression->head.digest ^ tables.path->head.digest ^ tables.torque->head.digest) * 0x100000001b3;
  }

  // Knots `kept` to N of the seed, which begins in the gait's slot; extend(k, x, u, x_next) where both feet rest. False: no guess.
  template <class G, int N, class Extend> bool go_on(const Gait<G>& gait, double ground, int kept, Seed<P, N>& seed, Extend extend) {
    static_assert(Task::gait_swing == G::swing && Task::gait_between == G::stance && Task::gait_before == G::lead && Task::dt == G::slot,
                  "the steps of the memory are the gait's");
    StepTask step;
    for (int k = kept, at; k < N;) {
      if (!walk_step<Task>(gait, gait.slot() + k, ground, step, at)) {
        if (k == kept) return false;
        extend(k, seed.x[k], seed.u[k], seed.x[k + 1]);
        ++k;
        continue;
      }
      if (!step_query<Task, Mirror>(tables, step, at, seed.x[k], work_, guess_) || guess_.status != kTabOk) return false;
      const int n = std::min(N - k, guess_.last - at);
      std::memcpy(seed.x[k + 1], guess_.x[at + 1], sizeof(seed.x[0]) * n);
      std::memcpy(seed.u[k], guess_.u[at], sizeof(seed.u[0]) * n);
      k += n;
    }
    return true;
  }

 private:
  StepWork<Task> work_;
  StepGuess<Task> guess_;
};

}  // namespace engram
#endif  // CONTROLLER_LOOP_LOOP_WALK_MEMORY_H_
