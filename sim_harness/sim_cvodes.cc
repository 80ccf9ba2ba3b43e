#include "sim_harness/sim_cvodes.h"

#include <cvodes/cvodes.h>
#include <nvector/nvector_serial.h>
#include <sundials/sundials_context.h>
#include <sunnonlinsol/sunnonlinsol_fixedpoint.h>

#include <cstdio>
#include <cstdlib>
#include <cstring>

namespace engram::sim {
namespace {

constexpr long kMostSteps = 1000000;  // per call; a smooth system takes tens

// Set-up calls fail on a wrong argument or without memory only: neither is the user's to mend.
void check(int flag, const char* call) {
  if (flag >= 0) return;
  std::fprintf(stderr, "CVODES: %s failed (%d)\n", call, flag);
  std::abort();
}

}  // namespace

struct Cvodes::Memory {
  SUNContext context = nullptr;
  void* cvodes = nullptr;
  N_Vector y = nullptr, *s = nullptr;
  SUNNonlinearSolver solver = nullptr, sensitivity_solver = nullptr;
};

Cvodes::Cvodes(int n, double tolerance, Rhs f, int ns, SensitivityRhs fs)
    : n_(n), ns_(ns), f_(std::move(f)), fs_(std::move(fs)), m_(std::make_unique<Memory>()) {
  Memory& m = *m_;
  check(SUNContext_Create(nullptr, &m.context), "SUNContext_Create");
  m.y = N_VNew_Serial(n, m.context);
  N_VConst(0.0, m.y);
  m.cvodes = CVodeCreate(CV_ADAMS, m.context);
  check(CVodeSetUserData(m.cvodes, this), "CVodeSetUserData");
  check(CVodeInit(
            m.cvodes,
            [](realtype t, N_Vector y, N_Vector dy, void* self) {
              static_cast<Cvodes*>(self)->f_(t, N_VGetArrayPointer(y), N_VGetArrayPointer(dy));
              return 0;
            },
            0.0, m.y),
        "CVodeInit");
  check(CVodeSStolerances(m.cvodes, tolerance, tolerance), "CVodeSStolerances");
  check(CVodeSetMaxNumSteps(m.cvodes, kMostSteps), "CVodeSetMaxNumSteps");
  m.solver = SUNNonlinSol_FixedPoint(m.y, 0, m.context);
  check(CVodeSetNonlinearSolver(m.cvodes, m.solver), "CVodeSetNonlinearSolver");
  if (ns == 0) return;
  m.s = N_VCloneVectorArray(ns, m.y);
  for (int i = 0; i < ns; ++i) N_VConst(0.0, m.s[i]);
  check(CVodeSensInit1(
            m.cvodes, ns, CV_SIMULTANEOUS,
            [](int, realtype t, N_Vector y, N_Vector, int column, N_Vector s, N_Vector ds, void* self, N_Vector, N_Vector) {
              static_cast<Cvodes*>(self)->fs_(t, N_VGetArrayPointer(y), column, N_VGetArrayPointer(s), N_VGetArrayPointer(ds));
              return 0;
            },
            m.s),
        "CVodeSensInit1");
  std::vector<double> absolute(ns, tolerance);
  check(CVodeSensSStolerances(m.cvodes, tolerance, absolute.data()), "CVodeSensSStolerances");
  check(CVodeSetSensErrCon(m.cvodes, SUNTRUE), "CVodeSetSensErrCon");
  m.sensitivity_solver = SUNNonlinSol_FixedPointSens(ns + 1, m.y, 0, m.context);
  check(CVodeSetNonlinearSolverSensSim(m.cvodes, m.sensitivity_solver), "CVodeSetNonlinearSolverSensSim");
}

Cvodes::~Cvodes() {
  CVodeFree(&m_->cvodes);
  SUNNonlinSolFree(m_->solver);
  if (m_->sensitivity_solver) SUNNonlinSolFree(m_->sensitivity_solver);
  if (m_->s) N_VDestroyVectorArray(m_->s, ns_);
  N_VDestroy(m_->y);
  SUNContext_Free(&m_->context);
}

std::string Cvodes::advance(double t0, double t1, double* y, double* s) {
  Memory& m = *m_;
  std::memcpy(N_VGetArrayPointer(m.y), y, sizeof(double) * n_);
  check(CVodeReInit(m.cvodes, t0, m.y), "CVodeReInit");
  for (int i = 0; i < ns_; ++i) std::memcpy(N_VGetArrayPointer(m.s[i]), s + i * n_, sizeof(double) * n_);
  if (ns_ > 0) check(CVodeSensReInit(m.cvodes, CV_SIMULTANEOUS, m.s), "CVodeSensReInit");
  check(CVodeSetStopTime(m.cvodes, t1), "CVodeSetStopTime");
  realtype t = t0;
  const int flag = CVode(m.cvodes, t1, m.y, &t, CV_NORMAL);
  if (flag < 0) {
    char* const name = CVodeGetReturnFlagName(flag);
    const std::string wrong = std::string("CVODES stopped: ") + name;
    std::free(name);
    return wrong;
  }
  std::memcpy(y, N_VGetArrayPointer(m.y), sizeof(double) * n_);
  if (ns_ > 0) check(CVodeGetSens(m.cvodes, &t, m.s), "CVodeGetSens");
  for (int i = 0; i < ns_; ++i) std::memcpy(s + i * n_, N_VGetArrayPointer(m.s[i]), sizeof(double) * n_);
  long steps = 0;
  CVodeGetNumSteps(m.cvodes, &steps);
  steps_ += steps;
  return "";
}

}  // namespace engram::sim
