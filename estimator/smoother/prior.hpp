#pragma once
// The prior from marginalized states: a quadratic cost on the remaining states.
//
//   cost(d) = 1/2 d^T H d + b^T d,   d = x [-] reference, stacked over the prior's blocks.
// d is in the error state of state.hpp (rotation on the right; calibration as in CalibrationLayout). The
// reference is the values at the last marginalization. The Hessian form is stored in double precision; the
// square-root form would only be better in single precision. Memory: 2.7 MiB, reserved by the constructor. H
// is full (both triangles), n x n, n = dimension().

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "estimator/core/fixed_vector.hpp"
#include "estimator/smoother/calibration_columns.hpp"
#include "estimator/smoother/cholesky.hpp"
#include "estimator/smoother/extra_states.hpp"
#include "estimator/smoother/gyro_intrinsics_state.hpp"
#include "estimator/smoother/state.hpp"

namespace swiftlet {

inline constexpr int kMaxSystemDim = static_cast<int>(kMaxStates) * kStateDim + kMaxCalibrationDim +
                                     kGyroMatrixDim + static_cast<int>(kMaxExtraStates) * kExtraDim;
/// Largest number of blocks: body states, extra states, calibration and gyro intrinsics.
inline constexpr std::size_t kMaxPriorBlocks = kMaxStates + kMaxExtraStates + 2;

/// Columns in the prior of one body state, one extra state, or the calibration.
struct PriorBlock {
  static constexpr std::uint8_t kCalibration = 255;
  static constexpr std::uint8_t kGyroIntrinsics = 254;
  std::uint8_t slot = 0;  ///< of a body state; of an extra state, from kMaxStates on; or a constant
  int dimension = 0;      ///< the first 6 or 15 columns of a body state, or all columns of others
  int offset = 0;         ///< first column in H and b
  BodyState reference;    ///< of a body state; extra states and calibration store their own

  [[nodiscard]] bool isState() const { return slot < kMaxStates + kMaxExtraStates; }
  [[nodiscard]] bool isExtra() const { return isState() && slot >= kMaxStates; }
};

class Prior {
 public:
  Prior();

  void clear();
  [[nodiscard]] bool empty() const { return dimension_ == 0; }
  [[nodiscard]] int dimension() const { return dimension_; }
  [[nodiscard]] const FixedVector<PriorBlock, kMaxPriorBlocks>& blocks() const { return blocks_; }
  [[nodiscard]] bool touches(std::uint8_t slot) const;

  MatrixMap H();
  VectorMap b();

  /// Starts a new set of blocks.
  void begin();
  /// Appends a block. At most kMaxPriorBlocks.
  void addBlock(std::uint8_t slot, int dimension, const BodyState& reference);
  /// After the last block: sizes H and b and sets them to zero, without allocation.
  void allocate();

 private:
  FixedVector<PriorBlock, kMaxPriorBlocks> blocks_;
  int dimension_ = 0;
  std::vector<double> h_;
  std::vector<double> b_;
};

}  // namespace swiftlet
