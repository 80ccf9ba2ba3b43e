// The compiled optimal control problem as a multiple-shooting nonlinear program, for Ipopt: hard constraints, and a rival for
// FDDP.
//
//   minimize  sum_k l_k(x_k, u_k)   subject to   f_k(x_k, u_k) - x_{k+1} = 0,   x_0 given,   z_lo <= z <= z_hi,   g(x_k) >= g_lo
//
// with z = (x_0 u_0 x_1 u_1 ... x_n). First derivatives are those of P::linearize, exact; the Hessian is its Gauss-Newton one, or
// Ipopt's own limited-memory approximation. Fixed bases only: a state is then a plain vector. Offline: heap, exceptions and I/O.
#ifndef CODEGEN_OFFLINE_IPOPT_SOLVE_H_
#define CODEGEN_OFFLINE_IPOPT_SOLVE_H_

#include <functional>
#include <string>
#include <vector>

namespace engram::offline {

// Sparse matrix entries: (row[i], column[i]) -> value[i].
struct Pattern {
  std::vector<int> row, column;
};

// A nonlinear program in Ipopt's terms; `evaluate` is called once for each new point.
struct Program {
  int variables = 0, constraints = 0;
  std::vector<double> z_lo, z_hi, g_lo, g_hi;
  Pattern jacobian, hessian;  // hessian: lower triangle of the objective's (entries may repeat; they add up)

  // written by evaluate
  double objective = 0.0;
  std::vector<double> gradient, g, jacobian_value, hessian_value;
  std::function<void(const double* z, Program&)> evaluate;
};

struct IpoptOptions {
  int iterations = 500;
  double tolerance = 1e-9;      // Ipopt's scaled optimality error
  bool limited_memory = false;  // else the Gauss-Newton Hessian
  int print_level = 0;          // 0 (silent) .. 12
};

struct IpoptResult {
  bool solved = false;
  std::string status;  // in words
  int iterations = 0;
  double objective = 0.0;
  double violation = 0.0;  // largest constraint violation, unscaled
  std::vector<double> z;
};

IpoptResult ipopt_solve(Program program, std::vector<double> z0, const IpoptOptions& options);

}  // namespace engram::offline
#endif  // CODEGEN_OFFLINE_IPOPT_SOLVE_H_
