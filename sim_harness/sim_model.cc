#include "sim_harness/sim_model.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>

namespace engram::sim {
namespace {

const char* program_name = "engram";

void on_error(const char* text) {
  std::fprintf(stderr, "%s: MuJoCo error: %s\n", program_name, text);
  std::exit(70);  // EX_SOFTWARE
}

void on_warning(const char* text) { std::fprintf(stderr, "%s: MuJoCo warning: %s\n", program_name, text); }

}  // namespace

void install_mujoco_handlers(const char* program) {
  program_name = program;
  mju_user_error = on_error;
  mju_user_warning = on_warning;
}

double position_error(const Pose& a, const Pose& b) {
  return std::sqrt((a.p[0] - b.p[0]) * (a.p[0] - b.p[0]) + (a.p[1] - b.p[1]) * (a.p[1] - b.p[1]) +
                   (a.p[2] - b.p[2]) * (a.p[2] - b.p[2]));
}

// angle = 2 atan2(|vec|, |w|) of conj(a) b: exact near 0, where acos of the scalar part is not
double rotation_error(const Pose& a, const Pose& b) {
  const double *p = a.quat, *q = b.quat;
  const double w = p[3] * q[3] + p[0] * q[0] + p[1] * q[1] + p[2] * q[2];
  const double x = p[3] * q[0] - p[0] * q[3] - p[1] * q[2] + p[2] * q[1];
  const double y = p[3] * q[1] - p[1] * q[3] - p[2] * q[0] + p[0] * q[2];
  const double z = p[3] * q[2] - p[2] * q[3] - p[0] * q[1] + p[1] * q[0];
  return 2.0 * std::atan2(std::sqrt(x * x + y * y + z * z), std::fabs(w));
}

Model::~Model() {
  if (d) mj_deleteData(d);
  if (m) mj_deleteModel(m);
}

std::string Model::load(const char* path) {
  char error[1000] = "";
  FILE* file = std::fopen(path, "r");
  if (!file) return std::string("cannot read the scene '") + path + "'; `make` generates it (engram robot, engram task)";
  std::fclose(file);
  m = mj_loadXML(path, nullptr, error, sizeof error);
  if (!m) {
    for (char* c = error; *c; ++c) {
      if (*c == '\n') *c = ' ';
    }
    return std::string("the scene '") + path + "' is not a valid MJCF: " + error;
  }
  d = mj_makeData(m);
  nq = m->nq, nv = m->nv, nu = m->nu;
  if (nq > kMaxDof || nv > kMaxDof) return std::string("the scene '") + path + "' has more than 64 coordinates";
  free_base = m->njnt > 0 && m->jnt_type[0] == mjJNT_FREE;
  while (nthruster < nu && m->actuator_trntype[nthruster] == mjTRN_SITE) ++nthruster;
  for (int i = nthruster; i < nu; ++i) {
    const bool fits = m->actuator_trntype[i] == mjTRN_JOINT && m->actuator_gear[6 * i] == 1.0 &&
                      m->jnt_dofadr[m->actuator_trnid[2 * i]] == nv - nu + i;
    if (!fits) {
      return std::string("actuator ") + std::to_string(i) + " of the scene '" + path +
             "' must drive degree of freedom nv - nu + " + std::to_string(i) + " with gear 1 (thrusters on sites come first)";
    }
  }
  const auto text = [&](const char* name) {
    const int i = mj_name2id(m, mjOBJ_TEXT, name);
    return std::string(i >= 0 ? m->text_data + m->text_adr[i] : "");
  };
  robot_digest = std::strtoull(text("robot_digest").c_str(), nullptr, 0);
  formula = text("formula");
  mj_forward(m, d);
  return "";
}

std::string Model::select_hand(const char* site) {
  hand_site = mj_name2id(m, mjOBJ_SITE, site);
  return hand_site >= 0 ? "" : std::string("the scene has no site named '") + site + "'";
}

void Model::get_state(double* q, double* v) const {
  std::memcpy(q, d->qpos, sizeof(double) * nq);
  std::memcpy(v, d->qvel, sizeof(double) * nv);
  if (!free_base) return;
  std::rotate(q + 3, q + 4, q + 7);  // w x y z -> x y z w
  double conjugate[4];
  mju_negQuat(conjugate, d->qpos + 3);
  mju_rotVecQuat(v, d->qvel, conjugate);  // world axes -> body axes
}

void Model::set_state(const double* q, const double* v) {
  std::memcpy(d->qpos, q, sizeof(double) * nq);
  std::memcpy(d->qvel, v, sizeof(double) * nv);
  if (!free_base) return;
  std::rotate(d->qpos + 3, d->qpos + 6, d->qpos + 7);  // x y z w -> w x y z
  mju_rotVecQuat(d->qvel, v, d->qpos + 3);             // body axes -> world axes
}

void Model::set_tau(const double* tau) { std::memcpy(d->ctrl, tau, sizeof(double) * nu); }

Pose Model::hand_pose() const {
  Pose pose{};
  if (hand_site < 0) return pose;
  mjtNum quat[4];
  mju_copy3(pose.p, d->site_xpos + 3 * hand_site);
  mju_mat2Quat(quat, d->site_xmat + 9 * hand_site);
  pose.quat[0] = quat[1], pose.quat[1] = quat[2], pose.quat[2] = quat[3], pose.quat[3] = quat[0];
  return pose;
}

double Model::tilt() const { return std::acos(std::clamp(d->xmat[9 * kBase + 8], -1.0, 1.0)); }
double Model::heading() const { return std::atan2(d->xmat[9 * kBase + 3], d->xmat[9 * kBase]); }

int Model::robot_world_contact() const {
  int deepest = -1;
  for (int i = 0; i < d->ncon; ++i) {
    const mjContact& contact = d->contact[i];
    const bool world1 = m->body_weldid[m->geom_bodyid[contact.geom1]] == 0;
    const bool world2 = m->body_weldid[m->geom_bodyid[contact.geom2]] == 0;
    if (world1 == world2 || contact.dist > 0) continue;
    if (deepest < 0 || contact.dist < d->contact[deepest].dist) deepest = i;
  }
  return deepest;
}

const char* Model::geom_label(int geom) const {
  const char* name = mj_id2name(m, mjOBJ_GEOM, geom);
  if (!name) name = mj_id2name(m, mjOBJ_BODY, m->geom_bodyid[geom]);
  return name ? name : "unnamed";
}

double Model::joint_excess() const {
  double excess = 0;
  for (int j = 0; j < m->njnt; ++j) {
    if (!m->jnt_limited[j] || m->jnt_type[j] == mjJNT_FREE || m->jnt_type[j] == mjJNT_BALL) continue;
    const double q = d->qpos[m->jnt_qposadr[j]];
    excess = std::max({excess, m->jnt_range[2 * j] - q, q - m->jnt_range[2 * j + 1]});
  }
  return excess;
}

double Model::torque_share() const {
  double share = 0;
  for (int i = 0; i < nu; ++i) {
    if (!m->actuator_ctrllimited[i]) continue;
    const double lo = m->actuator_ctrlrange[2 * i], hi = m->actuator_ctrlrange[2 * i + 1];
    share = std::max(share, std::fabs(d->ctrl[i] - 0.5 * (hi + lo)) / (0.5 * (hi - lo)));
  }
  return share;
}

}  // namespace engram::sim
