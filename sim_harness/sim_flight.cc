#include "sim_harness/sim_flight.h"

#include <algorithm>

namespace engram::sim {

std::string Flight::init(const Model& model) {
  const mjModel& m = *model.m;
  if (!model.free_base || m.njnt != 1 || model.nthruster != m.nu || m.nu == 0) {
    return "the CVODE plant simulates one free body on thrusters; leave --engine cvode away for this scene";
  }
  const int body = m.jnt_bodyid[0];
  mass_ = m.body_mass[body];
  mju_copy3(inertia_, m.body_inertia + 3 * body);
  mju_copy3(ipos_, m.body_ipos + 3 * body);
  mju_copy4(iquat_, m.body_iquat + 4 * body);
  mju_copy3(gravity_, m.opt.gravity);
  cvodes_ = std::make_unique<Cvodes>(13, kTolerance, [this](double, const double* y, double* dy) {
    const double *quat = y + 3, *v = y + 7, *w = y + 10;
    double force[3], twist[3], back[4], Iw[3], gyro[3];
    mju_copy3(dy, v);
    const double half_turn[4] = {0, 0.5 * w[0], 0.5 * w[1], 0.5 * w[2]};
    mju_mulQuat(dy + 3, quat, half_turn);
    mju_rotVecQuat(force, force_, quat);
    mju_negQuat(back, quat);
    mju_rotVecQuat(twist, twist_, back);
    for (int i = 0; i < 3; ++i) Iw[i] = inertia_[i] * w[i];
    mju_cross(gyro, w, Iw);
    for (int i = 0; i < 3; ++i) {
      dy[7 + i] = gravity_[i] + (force[i] + push_[i]) / mass_;
      dy[10 + i] = (torque_[i] + twist[i] - gyro[i]) / inertia_[i];
    }
  });
  return "";
}

std::string Flight::step(Model* model) {
  const mjModel& m = *model->m;
  mjData& d = *model->d;
  const int body = m.jnt_bodyid[0];

  // the thrusters' wrench about the centre of mass: a site's frame in the body, gear in the site's frame
  double to_principal[4], body_force[3] = {}, body_torque[3] = {};
  mju_negQuat(to_principal, iquat_);
  for (int i = 0; i < m.nu; ++i) {
    const int site = m.actuator_trnid[2 * i];
    const double* gear = m.actuator_gear + 6 * i;
    const double u = std::clamp(d.ctrl[i], m.actuator_ctrlrange[2 * i], m.actuator_ctrlrange[2 * i + 1]);
    double force[3], torque[3], arm[3], moment[3];
    mju_rotVecQuat(force, gear, m.site_quat + 4 * site);
    mju_rotVecQuat(torque, gear + 3, m.site_quat + 4 * site);
    mju_sub3(arm, m.site_pos + 3 * site, ipos_);
    mju_cross(moment, arm, force);
    mju_addToScl3(body_force, force, u);
    mju_addToScl3(body_torque, torque, u);
    mju_addToScl3(body_torque, moment, u);
  }
  mju_rotVecQuat(force_, body_force, to_principal);
  mju_rotVecQuat(torque_, body_torque, to_principal);
  mju_copy3(push_, d.xfrc_applied + 6 * body);
  mju_copy3(twist_, d.xfrc_applied + 6 * body + 3);

  // MuJoCo's state: origin of the body, linear velocity in world axes, angular in body axes
  double y[13], offset[3], arm_rate[3], w_body[3];
  mju_rotVecQuat(offset, ipos_, d.qpos + 3);
  mju_add3(y, d.qpos, offset);
  mju_mulQuat(y + 3, d.qpos + 3, iquat_);
  mju_cross(arm_rate, d.qvel + 3, ipos_);
  mju_rotVecQuat(arm_rate, arm_rate, d.qpos + 3);
  mju_add3(y + 7, d.qvel, arm_rate);
  mju_rotVecQuat(y + 10, d.qvel + 3, to_principal);

  const std::string wrong = cvodes_->advance(0.0, m.opt.timestep, y);
  if (!wrong.empty()) return wrong;

  mju_mulQuat(d.qpos + 3, y + 3, to_principal);
  mju_normalize4(d.qpos + 3);
  mju_rotVecQuat(offset, ipos_, d.qpos + 3);
  mju_sub3(d.qpos, y, offset);
  mju_rotVecQuat(w_body, y + 10, iquat_);
  mju_copy3(d.qvel + 3, w_body);
  mju_cross(arm_rate, w_body, ipos_);
  mju_rotVecQuat(arm_rate, arm_rate, d.qpos + 3);
  mju_sub3(d.qvel, y + 7, arm_rate);
  d.time += m.opt.timestep;
  return "";
}

}  // namespace engram::sim
