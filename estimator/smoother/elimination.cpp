#include "estimator/smoother/elimination.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "estimator/messages/nav_state.hpp"

namespace swiftlet {
namespace {

// Eigenvalues below this share of the largest carry no information.
constexpr double kRelativeRank = 1e-12;

using SmallMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kStateDim, kStateDim>;
// Fixed alignment of results: it determines which entries are computed in vectors, so that the numbers do not
// depend on where the compiler places a variable.
constexpr std::size_t kAlignment = 32;

using SmallVector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kStateDim, 1>;

// W with H^+ = W W^T: columns of U / sqrt(lambda).
SmallMatrix rootOfInverse(const SmallMatrix& H) {
  alignas(kAlignment) const Eigen::SelfAdjointEigenSolver<SmallMatrix> eigen(H);
  const double floor = kRelativeRank * std::max(eigen.eigenvalues().maxCoeff(), 1.0);
  alignas(kAlignment) SmallMatrix W = eigen.eigenvectors();
  for (Eigen::Index k = 0; k < W.cols(); ++k) {
    const double lambda = eigen.eigenvalues()[k];
    W.col(k) *= lambda > floor ? 1.0 / std::sqrt(lambda) : 0.0;
  }
  return W;
}

}  // namespace

void eliminateColumns(MatrixMap H, VectorMap g, ColumnRange leaving, std::span<const ColumnRange> others,
                      std::vector<double>& work) {
  const int at = leaving.offset;
  const int count = leaving.count;
  alignas(kAlignment) const SmallMatrix W = rootOfInverse(H.block(at, at, count, count));
  const SmallVector w_g = W.transpose() * g.segment(at, count);
  // Y = H W for the rows of each range, stored consecutively.
  const auto rowsOf = [&work, count](const ColumnRange& range) {
    return Eigen::Map<SmallMatrix>(work.data() + static_cast<std::ptrdiff_t>(range.offset) * kStateDim,
                                   range.count, count);
  };
  // Blocks are first copied to matrices of bounded size: products of blocks of H would allocate temporaries
  // on the heap.
  alignas(kAlignment) SmallMatrix Y;
  for (const ColumnRange& row : others) {
    const SmallMatrix H_row = H.block(row.offset, at, row.count, count);
    Y.noalias() = H_row * W;
    rowsOf(row) = Y;
    g.segment(row.offset, row.count).noalias() -= Y * w_g;
  }
  alignas(kAlignment) SmallMatrix H_block;
  for (const ColumnRange& row : others) {
    const Eigen::Map<SmallMatrix> Y_row = rowsOf(row);
    for (const ColumnRange& column : others) {
      H_block = H.block(row.offset, column.offset, row.count, column.count);
      H_block.noalias() -= Y_row * rowsOf(column).transpose();
      H.block(row.offset, column.offset, row.count, column.count) = H_block;
    }
  }
}

}  // namespace swiftlet
