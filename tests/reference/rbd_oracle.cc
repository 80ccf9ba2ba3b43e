// Rigid-body dynamics of one robot over batches of states, for tests in Python (ctypes); compiled by them:
//   -DROBOT=<type of engram::robots> -DROBOT_HEADER='"tables/<robot>/robot.h"'
// All arrays are row-major, one state after the other.
#include "controller/rbd/rbd_aba.h"
#include "controller/rbd/rbd_crba.h"
#include "controller/rbd/rbd_rnea.h"

#include ROBOT_HEADER

#include <algorithm>

using R = engram::robots::ROBOT;

// q (n x nq), v, a, tau (n x nv) -> rnea, aba (n x nv), crba (n x nv x nv)
extern "C" void rbd_dynamics(int n, const double* q, const double* v, const double* a, const double* tau, double* rnea, double* aba,
                             double* crba) {
  static engram::RbdData<R, double> d;
  for (int i = 0; i < n; ++i, q += R::nq, v += R::nv, a += R::nv, tau += R::nv, rnea += R::nv, aba += R::nv, crba += R::nv * R::nv) {
    engram::Mat<double, R::nv, R::nv> M;
    engram::rbd_rnea(q, v, a, d, rnea);
    engram::rbd_aba(q, v, tau, d, aba);
    engram::rbd_kinematics(q, d);
    engram::rbd_crba(d, M);
    std::copy_n(M.data(), R::nv * R::nv, crba);
  }
}
