// MuJoCo's rigid-body dynamics of a model file over batches of states, for tests in Python (ctypes).
// Constraints are off: limits and contacts are not what is compared. All arrays are row-major, one state after the other.
#include <mujoco/mujoco.h>

#include <algorithm>
#include <csetjmp>
#include <cstdio>
#include <cstring>

namespace {

std::jmp_buf failed;
char* message;
int message_size;

// MuJoCo's own handler would wait for Enter.
void on_error(const char* text) {
  std::snprintf(message, message_size, "%s", text);
  std::longjmp(failed, 1);
}

}  // namespace

// qpos (n x nq), qvel, qacc, force (n x nv), conventions of MuJoCo ->
//   M (n x nv x nv), bias (n x nv), inverse (n x nv) = M qacc + bias, forward (n x nv) = M^-1 (force - bias),
//   jacobian (n x 6 x nv) of a site: velocity of its origin, then angular velocity, in world axes
// Returns 0, or 1 with a text in `error`.
extern "C" int mujoco_dynamics(const char* file, const char* site, int n, int nq, int nv, const double* qpos, const double* qvel,
                               const double* qacc, const double* force, double* M, double* bias, double* inverse, double* forward,
                               double* jacobian, char* error, int error_size) {
  message = error;
  message_size = error_size;
  mju_user_error = on_error;
  if (setjmp(failed)) return 1;
  mjModel* m = mj_loadXML(file, nullptr, error, error_size);
  if (!m) return 1;
  const int id = mj_name2id(m, mjOBJ_SITE, site);
  if (m->nq != nq || m->nv != nv || id < 0) {
    std::snprintf(error, error_size, "%s: nq %d, nv %d, site %s %s", file, m->nq, m->nv, site, id < 0 ? "missing" : "found");
    mj_deleteModel(m);
    return 1;
  }
  m->opt.disableflags |= mjDSBL_CONSTRAINT;
  mjData* d = mj_makeData(m);
  for (int i = 0; i < n; ++i) {
    std::copy_n(qpos + i * nq, nq, d->qpos);
    std::copy_n(qvel + i * nv, nv, d->qvel);
    std::copy_n(force + i * nv, nv, d->qfrc_applied);
    mj_forward(m, d);
    mj_fullM(m, M + i * nv * nv, d->qM);
    std::copy_n(d->qfrc_bias, nv, bias + i * nv);
    std::copy_n(d->qacc, nv, forward + i * nv);
    mj_jacSite(m, d, jacobian + i * 6 * nv, jacobian + i * 6 * nv + 3 * nv, id);
    std::copy_n(qacc + i * nv, nv, d->qacc);
    mj_inverse(m, d);
    std::copy_n(d->qfrc_inverse, nv, inverse + i * nv);
  }
  mj_deleteData(d);
  mj_deleteModel(m);
  return 0;
}
