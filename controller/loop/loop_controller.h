// One controller: fast side and planner of a model M, in one block, behind the door. The planner is Planner<M> (loop_planner.h) or
// RecedingPlanner<M> (loop_receding.h).
#ifndef CONTROLLER_LOOP_LOOP_CONTROLLER_H_
#define CONTROLLER_LOOP_LOOP_CONTROLLER_H_

#include "controller/loop/loop_door.h"
#include "controller/loop/loop_fast.h"

#include <new>
#include <type_traits>

namespace engram {

template <class M, class PlannerOfM> struct LoopController : engram_controller {
  using P = typename M::P;
  static constexpr int N = M::N;
  static_assert(P::nx <= ENGRAM_NX_MAX && M::ntask <= ENGRAM_NTASK_MAX && N < ENGRAM_KNOTS_MAX, "bounds of engram.h");

  LoopController(const engram_model* m, const engram_options& o)
      : engram_controller{m, o}, fast(options), planner(options, fast) {}

  FastLoop<P, N, typename M::Hold> fast;
  PlannerOfM planner;
};

// The planner's choice among goals, if it has one.
template <class C, class PlannerOfM, class = void> struct GoalChooser {
  static constexpr int32_t (*kCall)(engram_controller*, const double*, const double*, const double*, int32_t, double*) = nullptr;
};
template <class C, class PlannerOfM> struct GoalChooser<C, PlannerOfM, std::void_t<decltype(&PlannerOfM::choose_goal)>> {
  static int32_t kCall(engram_controller* c, const double* q, const double* v, const double* goals, int32_t n, double* merit) {
    return static_cast<C*>(c)->planner.choose_goal(q, v, goals, n, merit);
  }
};

// The model of M. `constexpr` where it is defined, so that it lies in read-only memory.
template <class M, class PlannerOfM> constexpr engram_model loop_model(const char* robot, const char* task) {
  using C = LoopController<M, PlannerOfM>;
  using P = typename M::P;
  static_assert(std::is_trivially_destructible_v<C>, "a controller is forgotten, never destroyed");
  return {
      {robot, task, M::R::digest, M::Task::digest, P::nq, P::nv, P::nu, M::ntask, M::N, 1e-6 * M::kStepUs, M::kTickUs},
      sizeof(C),
      M::kIterations,
      M::Memory::tables_fit,
      M::Memory::table_digest,
      [](const engram_model* m, const engram_options& o, void* at) -> engram_controller* { return new (at) C(m, o); },
      [](engram_controller* c, int64_t utime, int32_t jump, const double* value, int n) {
        return static_cast<C*>(c)->planner.set_task(utime, jump, value, n);
      },
      [](engram_controller* c, int64_t utime) { return static_cast<C*>(c)->planner.prepare(utime); },
      [](engram_controller* c, int64_t utime, const double* q, const double* v) {
        return static_cast<C*>(c)->planner.feedback(utime, q, v);
      },
      [](engram_controller* c, int64_t utime, const double* q, const double* v, double* tau) {
        return static_cast<C*>(c)->fast.command(utime, q, v, tau);
      },
      [](const engram_controller* c) -> const engram_cycle& { return static_cast<const C*>(c)->planner.cycle(); },
      [](const engram_controller* c) -> const engram_jump& { return static_cast<const C*>(c)->planner.jump(); },
      [](const engram_controller* c, int64_t* utime, double* x, double* u, double* K) {
        return copy_plan(static_cast<const C*>(c)->planner.plan(), utime, x, u, K);
      },
      GoalChooser<C, PlannerOfM>::kCall,
  };
}

}  // namespace engram
#endif  // CONTROLLER_LOOP_LOOP_CONTROLLER_H_
