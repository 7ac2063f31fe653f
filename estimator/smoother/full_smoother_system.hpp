#pragma once
// The sparse system of full smoothing while it is built: internal to FullSmoother's sources.
//
// The lower triangle of the reduced normal equations, kStateDim columns a keyframe, as one block for each
// pair of keyframes that something ties. Contributions are summed as they come, in their order.
// Memory: 3.6 kB a keyframe, kPairBytes a pair of keyframes that are no neighbours.

#include <Eigen/Core>
#include <Eigen/SparseCore>
#include <algorithm>
#include <map>
#include <vector>

#include "estimator/smoother/full_smoother.hpp"

namespace swiftlet {

struct FullSmoother::System {
  /// A block of a std::map with its node, and its values and indices in the matrix and in the permuted copy
  /// of it that is factored.
  static constexpr std::size_t kPairBytes = 288 + 64 + 2 * 36 * 12;
  static constexpr std::size_t kKeyframeBytes = 2 * (225 * 8 + 2 * 225 * 12) + 128;

  Eigen::VectorXd g;

  void clear(std::size_t keyframes) {
    g = Eigen::VectorXd::Zero(kStateDim * static_cast<Eigen::Index>(keyframes));
    own_.assign(keyframes, Near{});
    next_.assign(keyframes, Near{});
    far_.assign(keyframes, {});
  }

  /// Of a whole state or of its pose with another; `row` and `column` are the first of their keyframes.
  /// Blocks above the diagonal are left out.
  template <typename Derived>
  void addBlock(Eigen::Index row, Eigen::Index column, const Eigen::MatrixBase<Derived>& block) {
    constexpr int kSize = Derived::RowsAtCompileTime;
    static_assert(kSize == kStateDim || kSize == kPoseDim);
    if (row < column) return;
    const Eigen::Matrix<double, kSize, kSize> value = block;
    const auto k = static_cast<std::size_t>(column / kStateDim);
    const auto other = static_cast<std::size_t>(row / kStateDim);
    if (other <= k + 1) {
      Near& near = other == k ? own_[k] : next_[k];
      near.size = std::max(near.size, kSize);
      near.H.template topLeftCorner<kSize, kSize>() += value;
    } else if constexpr (kSize == kPoseDim) {
      far_[k].try_emplace(other, Matrix6d::Constant(kNothing)).first->second += value;
    }
  }

  [[nodiscard]] Eigen::SparseMatrix<double> matrix() const {
    const Eigen::Index n = g.size();
    Eigen::SparseMatrix<double> H(n, n);
    H.reserve(entries());
    for (std::size_t k = 0; k < own_.size(); ++k) {
      const Eigen::Index at = kStateDim * static_cast<Eigen::Index>(k);
      for (Eigen::Index c = 0; c < kStateDim; ++c) {
        H.startVec(at + c);
        for (Eigen::Index r = c; c < own_[k].size && r < own_[k].size; ++r) {
          H.insertBack(at + r, at + c) = own_[k].H(r, c);
        }
        for (Eigen::Index r = 0; c < next_[k].size && r < next_[k].size; ++r) {
          H.insertBack(at + kStateDim + r, at + c) = next_[k].H(r, c);
        }
        if (c >= kPoseDim) continue;
        for (const auto& [other, block] : far_[k]) {
          const Eigen::Index row = kStateDim * static_cast<Eigen::Index>(other);
          for (Eigen::Index r = 0; r < kPoseDim; ++r) H.insertBack(row + r, at + c) = block(r, c);
        }
      }
    }
    H.finalize();
    return H;
  }

 private:
  /// The first addend comes out as it is, whatever the sign of its zeros.
  static constexpr double kNothing = -0.0;

  struct Near {
    int size = 0;  ///< 0: nothing ties them; else that of the largest block so far
    Matrix15d H = Matrix15d::Constant(kNothing);
  };

  [[nodiscard]] Eigen::Index entries() const {
    Eigen::Index count = 0;
    for (std::size_t k = 0; k < own_.size(); ++k) {
      count += own_[k].size * (own_[k].size + 1) / 2 + next_[k].size * next_[k].size;
      count += kPoseDim * kPoseDim * static_cast<Eigen::Index>(far_[k].size());
    }
    return count;
  }

  std::vector<Near> own_;                             ///< of a keyframe with itself
  std::vector<Near> next_;                            ///< rows of the next keyframe
  std::vector<std::map<std::size_t, Matrix6d>> far_;  ///< by column: rows of later keyframes
};

}  // namespace swiftlet
