#pragma once
// The sparse system of full smoothing; internal to FullSmoother's sources.
//
// The lower triangle of the reduced normal equations, kStateDim columns per keyframe: each keyframe has its
// own block and one with the previous keyframe, and each tied pair has a pose block. All pairs must be tied
// before anything is added; contributions are then summed. Memory: kKeyframeBytes per keyframe, kPairBytes
// per pair, including values and indices of the matrix.

#include <Eigen/Core>
#include <Eigen/SparseCore>
#include <algorithm>
#include <cstdint>
#include <iterator>
#include <span>
#include <utility>
#include <vector>

#include "estimator/smoother/full_smoother.hpp"
#include "estimator/smoother/landmark_block.hpp"
#include "estimator/smoother/padded_block.hpp"

namespace swiftlet {

struct FullSmoother::System {
  /// Memory of a block and its column, and of its values and indices in the matrix and in the factored copy.
  static constexpr std::size_t kPairBytes = sizeof(PaddedBlock) + sizeof(std::uint32_t) + 2 * 36 * 12;
  static constexpr std::size_t kKeyframeBytes = 2 * (225 * 8 + 2 * 225 * 12) + 128;

  Eigen::VectorXd g;
  LandmarkBlock landmark{kMaxStates};  ///< scratch for the current landmark

  /// Forgets all pairs except those of neighbours.
  void start(std::size_t keyframes) {
    rows_.assign(keyframes, {});
    own_.resize(keyframes);
    before_.resize(keyframes);
    for (std::uint32_t k = 0; k < keyframes; ++k) {
      if (k > 0) rows_[k].columns.push_back(k - 1);
      rows_[k].columns.push_back(k);
    }
    laid_ = false;
  }

  /// Ties all pairs of these keyframes, which must be in ascending order.
  void tie(std::span<const std::uint32_t> keyframes) {
    for (std::size_t i = 0; i < keyframes.size(); ++i) {
      std::vector<std::uint32_t>& columns = rows_[keyframes[i]].columns;
      const auto tied = keyframes.first(i + 1);
      if (std::ranges::includes(columns, tied)) continue;
      std::vector<std::uint32_t> all;
      std::ranges::set_union(columns, tied, std::back_inserter(all));
      columns = std::move(all);
    }
    laid_ = false;
  }

  /// Allocates and clears the system for all pairs tied so far.
  void clear() {
    if (!laid_) lay();
    g.setZero();
    for (Row& row : rows_) std::ranges::fill(row.blocks, PaddedBlock{});
    std::ranges::fill(own_, Matrix15d::Zero());
    std::ranges::fill(before_, Matrix15d::Zero());
  }

  /// Block of two tied keyframes, with row >= column. Only the lower triangle of a keyframe's own block is
  /// used.
  PaddedBlock& poseBlock(std::size_t row, std::size_t column) {
    Row& r = rows_[row];
    const auto at = std::ranges::lower_bound(r.columns, static_cast<std::uint32_t>(column));
    return r.blocks[static_cast<std::size_t>(at - r.columns.begin())];
  }
  void addPoses(std::size_t row, std::size_t column, const Matrix6d& block) {
    PaddedBlock& target = poseBlock(row, column);
    for (std::size_t c = 0; c < kPoseDim; ++c) {
      for (std::size_t r = 0; r < kPoseDim; ++r) {
        target.column[c][r] += block(static_cast<Eigen::Index>(r), static_cast<Eigen::Index>(c));
      }
    }
  }
  /// The keyframe's own block, and the block of its rows with the columns of the previous keyframe.
  Matrix15d& own(std::size_t keyframe) { return own_[keyframe]; }
  Matrix15d& before(std::size_t keyframe) { return before_[keyframe]; }

  /// True once after lay() if the pattern changed.
  [[nodiscard]] bool takeNewPattern() { return std::exchange(new_pattern_, false); }

  /// The matrix with its diagonal multiplied by 1 + damping.
  [[nodiscard]] const Eigen::SparseMatrix<double>& matrix(double damping) {
    double* value = H_.valuePtr();
    for (std::size_t k = 0; k < rows_.size(); ++k) {
      const PaddedBlock& own = rows_[k].blocks.back();
      for (std::size_t c = 0; c < kStateDim; ++c) {
        for (std::size_t r = c; r < kStateDim; ++r) {
          *value = at(own_[k], r, c) + (r < kPoseDim ? own.column[c][r] : 0.0);
          if (r == c) *value *= 1.0 + damping;
          ++value;
        }
        if (k + 1 < rows_.size()) {
          const PaddedBlock& next = *(rows_[k + 1].blocks.end() - 2);
          for (std::size_t r = 0; r < kStateDim; ++r) {
            *value++ = at(before_[k + 1], r, c) + (r < kPoseDim && c < kPoseDim ? next.column[c][r] : 0.0);
          }
        }
        if (c >= kPoseDim) continue;
        for (const Far& far : far_[k]) {
          for (std::size_t r = 0; r < kPoseDim; ++r) {
            *value++ = rows_[far.row].blocks[far.index].column[c][r];
          }
        }
      }
    }
    return H_;
  }

 private:
  struct Row {
    std::vector<std::uint32_t> columns;  ///< ascending; the last two are the previous and its own
    std::vector<PaddedBlock> blocks;
  };
  struct Far {
    std::uint32_t row = 0;
    std::uint32_t index = 0;  ///< of the block in its row
  };

  static double at(const Matrix15d& block, std::size_t r, std::size_t c) {
    return block(static_cast<Eigen::Index>(r), static_cast<Eigen::Index>(c));
  }

  // Allocates memory for all pairs and builds the pattern of the matrix.
  void lay() {
    const std::size_t n = rows_.size();
    far_.assign(n, {});
    Eigen::Index entries = 0;
    for (std::size_t k = 0; k < n; ++k) {
      rows_[k].blocks.resize(rows_[k].columns.size());
      entries += kStateDim * (kStateDim + 1) / 2 + (k > 0 ? kStateDim * kStateDim : 0);
      for (std::uint32_t i = 0; i + 2 < rows_[k].columns.size(); ++i) {
        far_[rows_[k].columns[i]].push_back({static_cast<std::uint32_t>(k), i});
        entries += kPoseDim * kPoseDim;
      }
    }
    const Eigen::Index dimension = kStateDim * static_cast<Eigen::Index>(n);
    g.resize(dimension);
    H_.resize(dimension, dimension);
    H_.reserve(entries);
    for (std::size_t k = 0; k < n; ++k) {
      const Eigen::Index first = kStateDim * static_cast<Eigen::Index>(k);
      for (Eigen::Index c = 0; c < kStateDim; ++c) {
        H_.startVec(first + c);
        const Eigen::Index last = k + 1 < n ? 2 * kStateDim : kStateDim;
        for (Eigen::Index r = c; r < last; ++r) H_.insertBack(first + r, first + c) = 0;
        if (c >= kPoseDim) continue;
        for (const Far& far : far_[k]) {
          for (Eigen::Index r = 0; r < kPoseDim; ++r) {
            H_.insertBack(kStateDim * static_cast<Eigen::Index>(far.row) + r, first + c) = 0;
          }
        }
      }
    }
    H_.finalize();
    laid_ = true;
    new_pattern_ = true;
  }

  bool laid_ = false;
  bool new_pattern_ = false;
  std::vector<Row> rows_;
  std::vector<Matrix15d> own_;
  std::vector<Matrix15d> before_;
  std::vector<std::vector<Far>> far_;  ///< by column
  Eigen::SparseMatrix<double> H_;
};

}  // namespace swiftlet
