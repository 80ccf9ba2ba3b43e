// Feasibility-driven differential dynamic programming (Mastalli et al., ICRA 2020) over a compile-time problem P.
//
//   minimize  sum_k l_k(x_k, u_k)   subject to   x_{k+1} = f_k(x_k, u_k),  x_0 given,  u_lo <= u <= u_hi (if opts.box)
//
// One iteration is three steps, one file each: linearize at (xs, us), sweep backward for the gains, roll out.
// The trajectory may be infeasible: gaps f_{k+1} = f_k(x_k, u_k) (-) x_{k+1} are kept and closed by steps of length 1.
//
// Four structs, four life times: FddpOpts (set once), FddpWork (scratch of one solve), FddpSolution (survives and seeds the next
// period), FddpStats (what happened). No heap, no exceptions, no I/O; a failure is a status.
#ifndef CONTROLLER_FDDP_FDDP_H_
#define CONTROLLER_FDDP_FDDP_H_

#include "controller/ocp/ocp_knot_model.h"

#include <cstdint>

namespace engram {

enum class FddpStatus : int32_t {
  kConverged,            // stop criterion met; the solution is the optimum found
  kIterationLimit,       // the solution is the best iterate
  kDeadline,             // time budget spent; the solution is the best iterate
  kNotPositiveDefinite,  // no descent direction up to the largest regularization; the solution is the last iterate
  kNotFinite,            // guess, parameters or derivatives are not finite; the solution is unchanged
  kBadHorizon,           // fddp_check refuses the horizon; the solution is unchanged
};

// Threads that the caller keeps outside the control period: run() calls task(context, i) for i = 0 .. threads - 1, side by side, and
// returns when all are done. Results are the same bits whatever their number.
struct FddpThreads {
  int threads = 1;
  void (*run)(void* self, void (*task)(void* context, int thread), void* context) = nullptr;
  void* self = nullptr;
};

struct FddpOpts {
  int iterations = 100;       // at most
  double stop = 1e-9;         // on |expected improvement of a full step|
  double stop_gradient = 0.0; // more than 0: on sum_k |Qu_k|^2 instead, at a trajectory without gaps (thesis, chapter 4)
  bool box = false;           // keep u within [u_lo, u_hi] of the problem
  int step_lengths = 10;      // line search tries 1, 1/2, 1/4, ... at most this many (1 .. kMaxStepLengths)
  double reg_init = 1e-9;     // added to the diagonals of Quu and Vxx
  double reg_min = 1e-9;
  double reg_max = 1e9;
  double reg_factor = 10.0;   // change of the regularization
  double accept = 0.1;        // accept a step that gains this share of the expected improvement
  double accept_negative = 2.0;    // while gaps close: accept a cost increase up to this multiple of the expected one
  double step_decrease_reg = 0.5;  // a longer step decreases the regularization
  double step_increase_reg = 0.01; // a step not longer than this increases it
  double gradient_zero = 1e-12;    // below this expected first-order gain any step is accepted
  double gap_zero = 1e-16;         // gaps below this count as closed
  double (*now_us)() = nullptr;    // clock for phase times and the deadline; null: neither
  double budget_us = 0.0;          // time budget from the start of the solve; 0: none
  FddpThreads threads = {};        // for the linearization; those beyond the first need FddpWork::more_lanes

  double now() const { return now_us ? now_us() : 0.0; }
};
inline constexpr int kMaxStepLengths = 12;

enum FddpPhase { kLinearize, kBackward, kRollout, kPhases };

// One iteration, as it ended.
struct FddpIteration {
  double cost = 0.0;         // of the accepted trajectory
  double stop = 0.0;         // |expected improvement| of the direction
  double step_length = 0.0;  // 0: none accepted
  double reg = 0.0;          // regularization after the iteration
  double gap = 0.0;          // L1 norm of the gaps before the step
  double gradient = 0.0;     // sum_k |Qu_k|^2 before the step
};

struct FddpStats {
  static constexpr int kLog = 256;
  FddpStatus status = FddpStatus::kIterationLimit;
  int iterations = 0;
  bool feasible = false;
  double us[kPhases] = {};  // time by phase, 0 without a clock
  FddpIteration log[kLog];  // the first kLog iterations
  const FddpIteration& last() const { return log[iterations == 0 ? 0 : (iterations < kLog ? iterations : kLog) - 1]; }
};

// The problem: start and the parameters of each knot. Knot n is the terminal one (dt = 0, no control).
template <class P, int N> struct Horizon {
  int n = 0;                                  // knots with a control, 0 <= n <= N
  Real x0[P::nx];                           // measured or predicted state
  unsigned phase[N + 1] = {};                  // what each knot is, for a problem with phases
  typename P::template Knot<Real> knot[N + 1];

  unsigned phase_of(int k) const { return k == n ? kTerminalPhase : phase[k]; }
};

// What is wrong with a horizon, if anything.
struct FddpHorizonError {
  const char* text = nullptr;  // null: nothing
  int knot = 0;
};
template <class P, int N> FddpHorizonError fddp_check(const Horizon<P, N>& h) {
  if (h.n < 0) return {"a horizon of fewer than 0 knots; count them again", 0};
  if (h.n > N) return {"a horizon longer than the compile-time maximum; shorten it, or raise N of Horizon, FddpWork, FddpSolution", N};
  for (int k = 0; k < h.n; ++k) {
    const bool impact = P::kPhases && (h.phase[k] & kImpactPhase) != 0;
    if (!impact && !(h.knot[k].dt > 0.0)) return {"a phase of no length; give the knot dt > 0, or leave it out", k};
  }
  return {};
}

template <class P, int N> struct FddpSolution {
  static constexpr int nxp = P::Layout::nxp;
  Real x[N + 1][P::nx];                   // states
  Real u[N][P::nu];                       // controls
  alignas(64) Real K[N][P::nu][nxp];      // gains: u = u_k - K_k (x (-) x_k), padded columns
  double cost;                            // of (x, u)
};

// Scratch of one solve; nothing in it needs to survive but between fddp_prepare and fddp_feedback.
template <class P, int N> struct FddpWork {
  using L = typename P::Layout;
  using Model = typename P::LqModel;
  // written by fddp_linearize
  Model model[N + 1];
  alignas(64) Real f[N + 1][L::nxp];      // gaps: f_0 = x0 (-) x_0, f_{k+1} = f_k(x_k, u_k) (-) x_{k+1}   (ndx)
  double gap, largest_gap;                // their L1 and largest norm
  double cost;                            // of the trajectory linearized at
  // written by fddp_backward
  alignas(64) Real k[N][L::nup];          // feed-forward: u = u_k - alpha k - K dx                          (nu)
  alignas(64) Real Vf[N + 1][L::nxp];     // Vxx f                                                           (ndx)
  double gradient;                        // sum_k |Qu_k|^2
  double dg, dq;                          // first and second order of the expected improvement without the term of the rollout
  alignas(64) Real Vx0[L::nxp];           // value gradient, dg and dq at the first knot before its gap: what fddp_feedback
  double dg0, dq0;                        // starts from when the measured state moves that gap
  // written by fddp_rollout: one step length a lane
  Pack x_try[N + 1][P::nx];
  Pack u_try[N][P::nu];
  // state of the iteration
  bool feasible, was_feasible;
  double reg;
  // scratch
  typename P::Lanes lanes;
  typename P::Lanes* more_lanes = nullptr;  // the caller's, one for each thread beyond the first
  alignas(64) Real Q[L::nzp][L::nzp], Qz[L::nzp];
  alignas(64) Real Vxx[L::nxp][L::nxp], Vx[L::nxp];
  alignas(64) Real Vvq[P::nv][padded(P::nv)], Vvv[P::nv][padded(P::nv)], Vqq[P::nv][padded(P::nv)];
  alignas(64) Real W[P::nv][L::nzp], GV[6][L::nxp];
  alignas(64) Real Luu[L::nup][L::nup], Y[P::nu][L::nxp];
};

}  // namespace engram
#endif  // CONTROLLER_FDDP_FDDP_H_
