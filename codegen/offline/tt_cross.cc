#include "codegen/offline/tt_cross.h"

#include <algorithm>
#include <limits>
#include <numeric>
#include <random>

namespace engram::offline {
namespace {

using Eigen::MatrixXd;
using Indices = std::vector<int32_t>;  // multi-indices of one length, row by row

// How many directions a pivoted QR finds, and an orthonormal basis of them.
MatrixXd basis_of(const MatrixXd& A, int most, double tolerance) {
  const Eigen::ColPivHouseholderQR<MatrixXd> qr(A);
  const auto diagonal = qr.matrixR().diagonal().cwiseAbs();
  int rank = 0;
  const int limit = std::min<int>({most, int(A.rows()), int(A.cols())});
  while (rank < limit && diagonal[rank] > tolerance * diagonal[0]) ++rank;
  rank = std::max(rank, 1);
  return qr.householderQ() * MatrixXd::Identity(A.rows(), rank);
}

// Chosen rows of `a` (length p each) side by side with... a row of left indices and a point, or a point and a row of right indices
Indices chosen_left(const Indices& left, int p, int n, const std::vector<int>& rows) {
  Indices out;
  for (int row : rows) {
    out.insert(out.end(), left.begin() + std::ptrdiff_t(row / n) * p, left.begin() + std::ptrdiff_t(row / n + 1) * p);
    out.push_back(row % n);
  }
  return out;
}
Indices chosen_right(const Indices& right, int p, int n, const std::vector<int>& rows) {
  Indices out;
  for (int row : rows) {
    out.push_back(row % n);
    out.insert(out.end(), right.begin() + std::ptrdiff_t(row / n) * p, right.begin() + std::ptrdiff_t(row / n + 1) * p);
  }
  return out;
}

class Cross {
 public:
  Cross(const GridFunction& f, const std::vector<int>& n, const Indices& starts, const CrossOptions& o)
      : f_(f), n_(n), d_(int(n.size())), starts_(starts), o_(o), random_(o.seed), left_(d_ + 1), right_(d_ + 1) {}

  Train run(int64_t& evaluations) {
    Train train{n_, std::vector<MatrixXd>(d_)};
    for (int sweep = 0; sweep < o_.sweeps; ++sweep) {
      const bool last = sweep + 1 >= o_.sweeps;
      const int m = sweep == 0 ? o_.rank : o_.enrich;
      if (o_.spread > 0) choose_starts(m);
      for (int k = 0; k + 1 < d_; ++k) train.core[k] = to_the_right(k, m);
      train.core[d_ - 1] = block(d_ - 1, left_[d_ - 1], count(left_[d_ - 1], d_ - 1), {}, 1);
      if (last) break;
      if (o_.spread > 0) choose_starts(o_.enrich);
      for (int k = d_ - 1; k > 0; --k) to_the_left(k);
    }
    evaluations = evaluations_;
    return train;
  }

 private:
  static int count(const Indices& indices, int length) { return length == 0 ? 1 : int(indices.size()) / length; }

  // Starting points of this sweep: of four times as many, drawn at random, the m that lie farthest apart in the first `spread` variables,
  // each found as the one farthest from those before it.
  void choose_starts(int m) {
    std::vector<int> order(starts_.size() / d_);
    std::iota(order.begin(), order.end(), 0);
    const std::size_t drawn = std::min(order.size(), std::size_t(4 * m));
    for (std::size_t i = 0; i < drawn; ++i) std::swap(order[i], order[i + random_() % (order.size() - i)]);
    order.resize(drawn);
    std::vector<double> away(drawn, std::numeric_limits<double>::infinity());
    chosen_.clear();
    for (std::size_t at = 0; int(chosen_.size()) < m && chosen_.size() < drawn;) {
      chosen_.push_back(order[at]);
      for (std::size_t i = 0; i < drawn; ++i) {
        double square = 0;
        for (int k = 0; k < o_.spread; ++k) {
          const double step = double(starts_[order[i] * d_ + k] - starts_[order[at] * d_ + k]) / n_[k];
          square += step * step;
        }
        away[i] = std::min(away[i], square);
      }
      away[at] = -1;
      at = std::size_t(std::max_element(away.begin(), away.end()) - away.begin());
    }
  }

  // Appends parts [begin, end) of this sweep's starting points that are not there yet; without spread those of m others, drawn at random
  // without repetition.
  void append_starts(Indices& indices, int begin, int end, int m) {
    const int length = end - begin;
    const auto append = [&](int start) {
      const int32_t* from = starts_.data() + std::size_t(start) * d_ + begin;
      for (std::size_t at = 0; at < indices.size(); at += length)
        if (std::equal(from, from + length, &indices[at])) return false;
      indices.insert(indices.end(), from, from + length);
      return true;
    };
    for (const int start : chosen_) append(start);
    if (o_.spread > 0) return;
    std::vector<int> order(starts_.size() / d_);
    std::iota(order.begin(), order.end(), 0);
    for (std::size_t i = 0; i < order.size() && m > 0; ++i) {
      std::swap(order[i], order[i + random_() % (order.size() - i)]);
      if (append(order[i])) --m;
    }
  }

  // Values of (left x points of k) x right: (r_k n_k, columns)
  MatrixXd block(int k, const Indices& left, int nleft, const Indices& right, int nright) {
    const int n = n_[k], p = k, q = d_ - 1 - k;
    std::vector<int32_t> index(std::size_t(nleft) * n * nright * d_);
    int32_t* at = index.data();
    for (int b = 0; b < nright; ++b)
      for (int a = 0; a < nleft; ++a)
        for (int i = 0; i < n; ++i, at += d_) {
          std::copy_n(left.data() + std::ptrdiff_t(a) * p, p, at);
          at[k] = i;
          std::copy_n(right.data() + std::ptrdiff_t(b) * q, q, at + k + 1);
        }
    MatrixXd A(std::ptrdiff_t(nleft) * n, nright);
    f_(index.data(), A.size(), A.data());
    evaluations_ += A.size();
    return A;
  }

  MatrixXd to_the_right(int k, int m) {
    const int q = d_ - 1 - k;
    Indices right = right_[k + 1];
    append_starts(right, k + 1, d_, m);
    const MatrixXd Q = basis_of(block(k, left_[k], count(left_[k], k), right, count(right, q)), o_.rank, o_.tolerance);
    const std::vector<int> rows = maxvol(Q);
    left_[k + 1] = chosen_left(left_[k], k, n_[k], rows);
    return Q * Q(rows, Eigen::all).inverse();
  }

  void to_the_left(int k) {
    const int q = d_ - 1 - k;
    Indices left = left_[k];
    append_starts(left, 0, k, o_.enrich);
    const int nleft = count(left, k), nright = count(right_[k + 1], q), n = n_[k];
    const MatrixXd A = block(k, left, nleft, right_[k + 1], nright);
    MatrixXd B(std::ptrdiff_t(n) * nright, nleft);  // row b n + i, column a
    for (int b = 0; b < nright; ++b)
      for (int a = 0; a < nleft; ++a) B.block(std::ptrdiff_t(b) * n, a, n, 1) = A.block(std::ptrdiff_t(a) * n, b, n, 1);
    right_[k] = chosen_right(right_[k + 1], q, n, maxvol(basis_of(B, o_.rank, o_.tolerance)));
  }

  const GridFunction& f_;
  const std::vector<int>& n_;
  const int d_;
  const Indices& starts_;
  const CrossOptions& o_;
  std::mt19937_64 random_;
  std::vector<int> chosen_;            // starting points of this sweep
  std::vector<Indices> left_, right_;  // left_[k]: indices of variables 0 .. k - 1; right_[k]: of k .. d - 1
  int64_t evaluations_ = 0;
};

}  // namespace

std::vector<int> maxvol(const MatrixXd& Q) {
  constexpr double kGrowth = 1.05;
  const int r = int(Q.cols());
  // rows that a pivoted LU of Q' would take, then exchanges while one makes the volume grow
  const Eigen::FullPivLU<MatrixXd> lu(Q.transpose());
  std::vector<int> rows(r);
  for (int j = 0; j < r; ++j) rows[j] = lu.permutationQ().indices()[j];
  MatrixXd B = Q * Q(rows, Eigen::all).inverse();
  for (int exchange = 0; exchange < 100; ++exchange) {
    Eigen::Index i, j;
    if (!(B.cwiseAbs().maxCoeff(&i, &j) > kGrowth)) break;
    Eigen::RowVectorXd change = B.row(i);
    change[j] -= 1.0;
    const Eigen::VectorXd column = B.col(j) / B(i, j);
    B -= column * change;
    rows[j] = int(i);
  }
  return rows;
}

Train tt_cross(const GridFunction& f, const std::vector<int>& n, const std::vector<int32_t>& starts, const CrossOptions& options,
               int64_t& evaluations) {
  return Cross(f, n, starts, options).run(evaluations);
}

Train tt_round(const Train& train, int rank, double tolerance) {
  Train out = train;
  const int d = train.d();
  const auto right_shape = [&](const MatrixXd& core, int k) {  // (r_k n, r_k+1) -> (r_k, n r_k+1), column b n + i
    const int n = train.n[k], r = int(core.rows()) / n, s = int(core.cols());
    MatrixXd M(r, std::ptrdiff_t(n) * s);
    for (int a = 0; a < r; ++a)
      for (int b = 0; b < s; ++b) M.block(a, std::ptrdiff_t(b) * n, 1, n) = core.block(std::ptrdiff_t(a) * n, b, n, 1).transpose();
    return M;
  };
  const auto left_shape = [&](const MatrixXd& M, int k) {
    const int n = train.n[k], r = int(M.rows()), s = int(M.cols()) / n;
    MatrixXd core(std::ptrdiff_t(r) * n, s);
    for (int a = 0; a < r; ++a)
      for (int b = 0; b < s; ++b) core.block(std::ptrdiff_t(a) * n, b, n, 1) = M.block(a, std::ptrdiff_t(b) * n, 1, n).transpose();
    return core;
  };
  // core k times a factor (r_k+1, s) on its right
  for (int k = d - 1; k > 0; --k) {  // right-orthogonal
    const MatrixXd M = right_shape(out.core[k], k);
    const Eigen::HouseholderQR<MatrixXd> qr(M.transpose());
    const int r = int(std::min(M.rows(), M.cols()));
    const MatrixXd Q = qr.householderQ() * MatrixXd::Identity(M.cols(), r);
    const MatrixXd R = qr.matrixQR().topRows(r).template triangularView<Eigen::Upper>();
    out.core[k] = left_shape(Q.transpose(), k);
    out.core[k - 1] = out.core[k - 1] * R.transpose();
  }
  for (int k = 0; k + 1 < d; ++k) {  // truncated, left-orthogonal
    const Eigen::JacobiSVD<MatrixXd> svd(out.core[k], Eigen::ComputeThinU | Eigen::ComputeThinV);
    const auto& sigma = svd.singularValues();
    int r = 0;
    while (r < std::min<int>(rank, int(sigma.size())) && (r == 0 || sigma[r] > tolerance * sigma[0])) ++r;
    const MatrixXd carry = sigma.head(r).asDiagonal() * svd.matrixV().leftCols(r).transpose();
    out.core[k] = svd.matrixU().leftCols(r);
    out.core[k + 1] = left_shape(carry * right_shape(out.core[k + 1], k + 1), k + 1);
  }
  return out;
}

}  // namespace engram::offline
