// Tensor-train cross approximation: a train of a function on a grid, from a small part of its values.
#ifndef CODEGEN_OFFLINE_TT_CROSS_H_
#define CODEGEN_OFFLINE_TT_CROSS_H_

#include <Eigen/Dense>

#include <cstdint>
#include <functional>
#include <vector>

namespace engram::offline {

// Values (m) of the function at m grid points, index (m, d).
using GridFunction = std::function<void(const int32_t* index, std::size_t m, double* value)>;

// Cores k = 0 .. d - 1 as matrices (r_k n_k, r_k+1), row a n_k + i: left index a, grid point i.
struct Train {
  std::vector<int> n;
  std::vector<Eigen::MatrixXd> core;
  int d() const { return int(n.size()); }
  int rank(int k) const { return k == 0 ? 1 : int(core[k - 1].cols()); }
};

struct CrossOptions {
  int rank = 20;            // largest rank
  int enrich = 8;           // starting points of a sweep; their parts join the columns (or rows) of its blocks. The first has `rank`
  int sweeps = 4;           // there and back is two; the last one runs to the right
  int spread = 0;           // > 0: one set of starting points for all blocks of a sweep, apart in so many leading variables; 0: each block draws
  double tolerance = 1e-8;  // directions of a block smaller than this, relative to its largest, do not count
  uint64_t seed = 1;        // chooses among the starting points
};

// Cross approximation from starting points (m, d), grid indices of points where the function is large. Each block
// (left indices x points of variable k) x (right indices) is evaluated whole; a pivoted QR decides how many directions it has, maxvol which of
// its rows carry them: the rank adapts itself up to options.rank. `evaluations` counts values of the function.
// Source: Oseledets & Tyrtyshnikov, TT-cross approximation (2010); thesis B.2 (text line 2172), which starts from random indices.
Train tt_cross(const GridFunction& f, const std::vector<int>& n, const std::vector<int32_t>& starts, const CrossOptions& options,
               int64_t& evaluations);

// The nearest train of rank at most `rank`, left-orthogonal, dropping what is below tolerance times its norm (TT-SVD).
// Source: Oseledets, Tensor-train decomposition (2011), algorithm 2.
Train tt_round(const Train& train, int rank, double tolerance);

// Rows of Q (m, r), m >= r, of nearly largest volume: r of them.  Source: Goreinov et al., How to find a good submatrix (2010).
std::vector<int> maxvol(const Eigen::MatrixXd& Q);

}  // namespace engram::offline
#endif  // CODEGEN_OFFLINE_TT_CROSS_H_
