// A Panda without contacts for tests in process: forward dynamics of the controller's own rbd, one step per millisecond.
#ifndef TESTS_SUPPORT_PANDA_PLANT_H_
#define TESTS_SUPPORT_PANDA_PLANT_H_

#include <cstring>
#include <vector>

#include "controller/engram.h"
#include "controller/rbd/rbd_forward.h"
#include "tables/panda/robot.h"

namespace engram::test {

struct PandaPlant {
  using R = robots::Panda;
  static constexpr int64_t kStepUs = 1000;
  int64_t utime = 0;
  double q[R::nq], v[R::nv] = {};

  PandaPlant() { std::memcpy(q, R::q_home, sizeof q); }
  void step(const double* tau) {
    RbdData<R, double> d;
    double a[R::nv];
    rbd_forward_dynamics<R>(q, v, tau, d, a);
    for (int i = 0; i < R::nv; ++i) {
      v[i] += 1e-6 * kStepUs * a[i];
      q[i] += 1e-6 * kStepUs * v[i];
    }
    utime += kStepUs;
  }
};

// A controller in memory of its own.
class PandaController {
 public:
  explicit PandaController(const engram_options* options = nullptr) : memory_(engram_sizeof(&engram_panda_reach)) {
    error = engram_init(&engram_panda_reach, memory_.data(), memory_.size(), options, &handle);
  }
  engram_error error;
  engram_controller* handle = nullptr;

  // One millisecond of the closed loop: feedback at a tick, command, the plant's step, plan for the next tick. Returns the command's status.
  engram_status step(PandaPlant& plant) {
    const bool tick = plant.utime % engram_describe(&engram_panda_reach)->tick_us == 0;
    if (tick) engram_feedback(handle, plant.utime, plant.q, plant.v);
    const engram_status status = engram_command(handle, plant.utime, plant.q, plant.v, tau);
    const int64_t now = plant.utime;
    plant.step(tau);
    if (tick) engram_prepare(handle, now + engram_describe(&engram_panda_reach)->tick_us);
    return status;
  }
  engram_cycle cycle() const {
    engram_cycle c;
    engram_cycle_info(handle, &c);
    return c;
  }
  double tau[PandaPlant::R::nu] = {};

 private:
  std::vector<unsigned char> memory_;
};

// Two targets in free space in front of the arm, hand pointing down: every mode reaches them from q_home.
inline constexpr double kTaskNear[7] = {0.30, 0.15, 0.45, 1.0, 0.0, 0.0, 0.0};
inline constexpr double kTaskRight[7] = {0.30, -0.20, 0.55, 1.0, 0.0, 0.0, 0.0};

}  // namespace engram::test
#endif  // TESTS_SUPPORT_PANDA_PLANT_H_
