#include "tests/support/legged_plant.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>

namespace engram::test {
namespace {

mjModel* load(const std::string& scene) {
  char error[1000] = "";
  mjModel* const m = mj_loadXML(scene.c_str(), nullptr, error, sizeof error);
  if (m == nullptr) {
    std::fprintf(stderr, "%s: %s; run in the root of the repository\n", scene.c_str(), error);
    std::exit(66);  // EX_NOINPUT
  }
  return m;
}

}  // namespace

LeggedPlant::LeggedPlant(const engram_model* model, double heading)
    : m_(load(std::string("tables/") + engram_describe(model)->robot + "_" + engram_describe(model)->task + "/scene.xml")),
      d_(mj_makeData(m_)) {
  m_->opt.timestep = 1e-6 * kStepUs;
  mj_resetDataKeyframe(m_, d_, 0);
  double turn[4] = {std::cos(0.5 * heading), 0.0, 0.0, std::sin(0.5 * heading)}, home[7];
  std::memcpy(home, d_->qpos, sizeof home);
  mju_rotVecQuat(d_->qpos, home, turn);
  mju_mulQuat(d_->qpos + 3, turn, home + 3);
  q.resize(static_cast<size_t>(m_->nq));
  v.resize(static_cast<size_t>(m_->nv));
  delay(0);
  measure();
}

LeggedPlant::~LeggedPlant() {
  mj_deleteData(d_);
  mj_deleteModel(m_);
}

void LeggedPlant::delay(int steps) {
  delay_ = steps;
  under_way_.resize(static_cast<size_t>((1 + steps) * m_->nu));
}

void LeggedPlant::step(const double* tau) {
  const auto slot = [this](int64_t step) { return under_way_.data() + step % (1 + delay_) * m_->nu; };
  std::copy_n(tau, m_->nu, slot(steps_));
  std::copy_n(slot(std::max<int64_t>(0, steps_ - delay_)), m_->nu, d_->ctrl);  // until the first one acts, it acts already
  ++steps_;
  mj_step(m_, d_);
  utime += kStepUs;
  measure();
}

void LeggedPlant::push(const char* body, const double (&force)[3]) {
  const int id = mj_name2id(m_, mjOBJ_BODY, body);
  for (int i = 0; i < 3; ++i) d_->xfrc_applied[6 * id + i] = force[i];
}

void LeggedPlant::add_mass(const char* body, double mass) {
  m_->body_mass[mj_name2id(m_, mjOBJ_BODY, body)] += mass;
  mjData* const scratch = mj_makeData(m_);
  mj_setConst(m_, scratch);
  mj_deleteData(scratch);
}

void LeggedPlant::friction(double mu) { m_->geom_friction[3 * mj_name2id(m_, mjOBJ_GEOM, "ground")] = mu; }

// A sole that is lower on its foot meets level ground as early as the sole itself meets ground that is higher.
void LeggedPlant::raise_ground(const char* sole, double height) {
  const int g = mj_name2id(m_, mjOBJ_GEOM, sole);
  double& raised = ground_[sole];
  double up[3];
  const double z[3] = {0.0, 0.0, 1.0};
  mju_rotVecQuat(up, z, m_->geom_quat + 4 * g);
  for (int i = 0; i < 3; ++i) m_->geom_pos[3 * g + i] -= (height - raised) * up[i];
  raised = height;
}

// MuJoCo: quaternion w first, linear velocity in world axes. Ours: w last, body axes.
void LeggedPlant::measure() {
  mj_kinematics(m_, d_);
  mj_comPos(m_, d_);
  mj_subtreeVel(m_, d_);
  std::memcpy(q.data(), d_->qpos, sizeof(double) * q.size());
  std::memcpy(v.data(), d_->qvel, sizeof(double) * v.size());
  for (size_t i = 0; i < 3; ++i) q[3 + i] = d_->qpos[4 + i];
  q[6] = d_->qpos[3];
  double conjugate[4], body[3];
  mju_negQuat(conjugate, d_->qpos + 3);
  mju_rotVecQuat(body, d_->qvel, conjugate);
  std::memcpy(v.data(), body, sizeof body);
  std::memcpy(com, d_->subtree_com + 3, sizeof com);
  std::memcpy(com_velocity, d_->subtree_linvel + 3, sizeof com_velocity);
}

double LeggedPlant::base_up() const { return d_->xmat[9 + 8]; }
double LeggedPlant::yaw() const { return std::atan2(d_->xmat[9 + 3], d_->xmat[9]); }

LeggedController::LeggedController(const engram_model* model, const engram_options* options)
    : tau(static_cast<size_t>(engram_describe(model)->nu)), memory_(engram_sizeof(model)) {
  error = engram_init(model, memory_.data(), memory_.size(), options, &handle);
}

engram_status LeggedController::step(LeggedPlant& plant) {
  const int64_t tick = engram_describe(engram_model_of(handle))->tick_us, now = plant.utime;
  if (now % tick == 0) {
    engram_feedback(handle, now, plant.q.data(), plant.v.data());
    engram_cycle_info(handle, &cycle_);
  }
  const engram_status status = engram_command(handle, now, plant.q.data(), plant.v.data(), tau.data());
  plant.step(tau.data());
  if (now % tick == 0) engram_prepare(handle, now + tick);
  return status;
}

}  // namespace engram::test
