// From a compiled problem P and its horizon to a nonlinear program.
#ifndef CODEGEN_OFFLINE_IPOPT_SHOOTING_H_
#define CODEGEN_OFFLINE_IPOPT_SHOOTING_H_

#include "codegen/offline/ipopt_solve.h"
#include "controller/fddp/fddp.h"

#include <algorithm>
#include <limits>
#include <memory>
#include <vector>

namespace engram::offline {

// Hard bounds, the same at every knot; by default none.
template <class P> struct StateBounds {
  std::vector<double> x_lo = std::vector<double>(P::nx, -std::numeric_limits<double>::infinity());
  std::vector<double> x_hi = std::vector<double>(P::nx, std::numeric_limits<double>::infinity());
  bool control_box = false;  // P::u_lo <= u <= P::u_hi
};

// An inequality g(q) >= 0 on every knot but the first, `count` rows; both outputs row-major, dg (count x nv).
struct PathConstraint {
  int count = 0;
  std::function<void(const double* q, double* g, double* dg)> evaluate;
};

// Where things stand among the variables z = (x_0 u_0 x_1 u_1 ... x_n), and the program over them.
template <class P, int N> class Shooting {
  static_assert(!P::kFreeBase, "the state is taken as a plain vector");
  using L = typename P::Layout;
  using Model = KnotModel<L, P::kFreeBase, double>;
  static constexpr int nx = P::nx, nu = P::nu, nv = P::nv;

 public:
  Shooting(const Horizon<P, N>& horizon, const StateBounds<P>& bounds, const PathConstraint& path)
      : h_(horizon), path_(path), model_(std::make_unique<Model>()) {
    program_.variables = x_at(h_.n) + nx;
    program_.constraints = h_.n * (nx + path_.count);
    set_bounds(bounds);
    for (int k = 0; k <= h_.n; ++k) {
      if (k < h_.n) add_dynamics(k);
      if (k > 0) add_path(k);
      for (int i = 0; i < size(k); ++i)
        for (int j = 0; j <= i; ++j) add(program_.hessian, x_at(k) + i, x_at(k) + j);
    }
  }

  static int x_at(int k) { return k * (nx + nu); }
  static int u_at(int k) { return x_at(k) + nx; }

  // The program refers to this object, which must outlive the solve.
  Program program() {
    Program program = program_;
    program.evaluate = [this](const double* z, Program& p) { evaluate(z, p); };
    return program;
  }

  std::vector<double> pack(const double* xs, const double* us) const {
    std::vector<double> z(program_.variables);
    for (int k = 0; k <= h_.n; ++k) std::copy_n(xs + k * nx, nx, &z[x_at(k)]);
    for (int k = 0; k < h_.n; ++k) std::copy_n(us + k * nu, nu, &z[u_at(k)]);
    return z;
  }

 private:
  int size(int k) const { return k < h_.n ? nx + nu : nx; }  // of z_k = (x_k, u_k)
  static void add(Pattern& pattern, int row, int column) {
    pattern.row.push_back(row);
    pattern.column.push_back(column);
  }

  void set_bounds(const StateBounds<P>& bounds) {
    Program& p = program_;
    for (int k = 0; k <= h_.n; ++k) {
      p.z_lo.insert(p.z_lo.end(), bounds.x_lo.begin(), bounds.x_lo.end());
      p.z_hi.insert(p.z_hi.end(), bounds.x_hi.begin(), bounds.x_hi.end());
      for (int i = 0; k < h_.n && i < nu; ++i) {
        constexpr double none = std::numeric_limits<double>::infinity();
        p.z_lo.push_back(bounds.control_box ? P::u_lo(i) : -none);
        p.z_hi.push_back(bounds.control_box ? P::u_hi(i) : none);
      }
    }
    for (int i = 0; i < nx; ++i) p.z_lo[i] = p.z_hi[i] = h_.x0[i];
    p.g_lo.assign(p.constraints, 0.0);
    p.g_hi.assign(p.constraints, 0.0);
    std::fill(p.g_hi.begin() + h_.n * nx, p.g_hi.end(), std::numeric_limits<double>::infinity());
  }

  // rows k nx ..: f(x_k, u_k) - x_{k+1};  d q' = d q + dt D dz,  d v' = D dz
  void add_dynamics(int k) {
    for (int i = 0; i < nx; ++i) {
      for (int j = 0; j < nx + nu; ++j) add(program_.jacobian, k * nx + i, x_at(k) + j);
      add(program_.jacobian, k * nx + i, x_at(k + 1) + i);
    }
  }

  void add_path(int k) {
    for (int i = 0; i < path_.count; ++i)
      for (int j = 0; j < nv; ++j) add(program_.jacobian, h_.n * nx + (k - 1) * path_.count + i, x_at(k) + j);
  }

  void evaluate(const double* z, Program& p) {
    Model& m = *model_;
    double* jacobian = p.jacobian_value.data();
    double* hessian = p.hessian_value.data();
    double x_next[nx], cost;
    const double no_control[nu] = {};
    p.objective = 0.0;
    for (int k = 0; k <= h_.n; ++k) {
      const double* x = z + x_at(k);
      P::linearize(h_.knot[k], x, k < h_.n ? z + u_at(k) : no_control, x_next, cost, m);
      p.objective += cost;
      for (int i = 0; i < size(k); ++i) p.gradient[x_at(k) + i] = m.Lz[padded_index<L>(i)];
      if (k < h_.n) {
        const double dt = h_.knot[k].dt;
        for (int i = 0; i < nx; ++i) {
          p.g[k * nx + i] = x_next[i] - z[x_at(k + 1) + i];
          const double* D = m.D[i % nv];
          for (int j = 0; j < nx + nu; ++j) {
            const double d = D[padded_index<L>(j)];
            *jacobian++ = i < nv ? dt * d + (i == j) : d;
          }
          *jacobian++ = -1.0;
        }
      }
      if (k > 0 && path_.count > 0) {
        path_.evaluate(x, &p.g[h_.n * nx + (k - 1) * path_.count], jacobian);
        jacobian += path_.count * nv;
      }
      for (int i = 0; i < size(k); ++i)
        for (int j = 0; j <= i; ++j) *hessian++ = m.Lzz[padded_index<L>(i)][padded_index<L>(j)];
    }
  }

  const Horizon<P, N>& h_;
  PathConstraint path_;
  std::unique_ptr<Model> model_;
  Program program_;
};

}  // namespace engram::offline
#endif  // CODEGEN_OFFLINE_IPOPT_SHOOTING_H_
