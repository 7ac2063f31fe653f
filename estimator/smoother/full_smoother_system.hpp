#pragma once
// The sparse system of full smoothing while it is built: internal to FullSmoother's sources.
//
// The reduced normal equations, kStateDim columns a keyframe, as triplets of their lower triangle.
// Memory: 16 bytes an entry; entries grow with the squares of the tracks' lengths.

#include <Eigen/Core>
#include <Eigen/SparseCore>
#include <vector>

#include "estimator/smoother/full_smoother.hpp"

namespace swiftlet {

struct FullSmoother::System {
  std::vector<Eigen::Triplet<double>> H;
  Eigen::VectorXd g;

  /// Entries above the diagonal are left out: `row` must be at least `column`.
  template <typename Derived>
  void addBlock(Eigen::Index row, Eigen::Index column, const Eigen::MatrixBase<Derived>& block) {
    for (Eigen::Index c = 0; c < block.cols(); ++c) {
      for (Eigen::Index r = 0; r < block.rows(); ++r) {
        if (row + r < column + c) continue;
        H.emplace_back(static_cast<int>(row + r), static_cast<int>(column + c), block(r, c));
      }
    }
  }
};

}  // namespace swiftlet
