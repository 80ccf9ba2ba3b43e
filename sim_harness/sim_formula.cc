#include "sim_harness/sim_formula.h"

#include <algorithm>
#include <cmath>
#include <iterator>

namespace engram::sim {
namespace {

constexpr double kG = 9.81;  // m/s^2

// A point mass of 1 kg on a rod of 1 m, 0.1 N m s/rad of friction; q: angle from upright, u: torque.
void pendulum(const double* q, const double* v, const double* u, double* out) {
  out[0] = kG * std::sin(q[0]) - 0.1 * v[0] + u[0];
}

// q: x, y, heading; u: speed, turning rate.
void unicycle(const double* q, const double*, const double* u, double* out) {
  out[0] = u[0] * std::cos(q[2]);
  out[1] = u[0] * std::sin(q[2]);
  out[2] = u[1];
}

// A beam of 2.5 kg and 1.2 kg m^2, thrusts 0.5 m right and left of its middle; q: x, z, pitch.
void bicopter(const double* q, const double*, const double* u, double* out) {
  out[0] = -(u[0] + u[1]) * std::sin(q[2]) / 2.5;
  out[1] = (u[0] + u[1]) * std::cos(q[2]) / 2.5 - kG;
  out[2] = 0.5 * (u[0] - u[1]) / 1.2;
}

constexpr Formula::System kSystems[] = {
    {"pendulum", 1, 1, 2, pendulum, {1.0}},
    {"unicycle", 3, 2, 1, unicycle, {}},
    {"bicopter", 3, 2, 2, bicopter, {2.5, 2.5, 1.2}},
};

}  // namespace

std::string Formula::init(const Model& model) {
  const auto* const found =
      std::find_if(std::begin(kSystems), std::end(kSystems), [&](const System& s) { return model.formula == s.name; });
  if (found == std::end(kSystems)) return "there is no formula '" + model.formula + "'; write it in sim_harness/sim_formula.cc";
  if (model.nq != found->n || model.nv != found->n || model.nu != found->nu) {
    return "the scene's joints and controls are not those of the formula '" + model.formula + "'; mend its robot.toml or URDF";
  }
  system_ = found;
  const int n = found->n;
  cvodes_ = std::make_unique<Cvodes>(n * found->order, kTolerance, [this, n](double, const double* y, double* dy) {
    if (system_->order == 1) return system_->rate(y, nullptr, u_, dy);
    std::copy(y + n, y + 2 * n, dy);
    system_->rate(y, y + n, u_, dy + n);
    for (int i = 0; i < n; ++i) dy[n + i] += push_[i] / system_->inertia[i];
  });
  return "";
}

std::string Formula::step(Model* model) {
  const mjModel& m = *model->m;
  mjData& d = *model->d;
  const int n = system_->n;
  for (int i = 0; i < m.nu; ++i) u_[i] = std::clamp(d.ctrl[i], m.actuator_ctrlrange[2 * i], m.actuator_ctrlrange[2 * i + 1]);
  std::fill(push_, push_ + n, 0.0);
  for (int body = 1; body < m.nbody; ++body) {
    const double* const applied = d.xfrc_applied + 6 * body;
    mj_applyFT(&m, &d, applied, applied + 3, d.xipos + 3 * body, body, push_);
  }
  double y[6];
  std::copy(d.qpos, d.qpos + n, y);
  std::copy(d.qvel, d.qvel + n, y + n);
  const std::string wrong = cvodes_->advance(0.0, m.opt.timestep, y);
  if (!wrong.empty()) return wrong;
  if (system_->order == 1) system_->rate(y, nullptr, u_, y + n);
  std::copy(y, y + n, d.qpos);
  std::copy(y + n, y + 2 * n, d.qvel);
  d.time += m.opt.timestep;
  return "";
}

}  // namespace engram::sim
