#pragma once
// What marginalized states left behind: a quadratic cost on the states that remain.
//
//   cost(d) = 1/2 d^T H d + b^T d,   d = x [-] reference, stacked over the prior's blocks.
// d is in the error state of state.hpp (rotation on the right; calibration as in CalibrationLayout).
// For frozen states the reference is their first estimate. The Hessian form is kept in double
// precision, which the sqrt-form's advantage (float) does not concern.
// Memory: 1.1 MiB, reserved by the constructor. H is full (both triangles), n x n, n = dimension().

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "estimator/core/fixed_vector.hpp"
#include "estimator/smoother/cholesky.hpp"
#include "estimator/smoother/state.hpp"

namespace swiftlet {

/// Columns of the calibration block: time offset (1), then phi, p of T_body_cam per camera.
inline constexpr int kMaxCalibrationDim = 13;
inline constexpr int kMaxSystemDim = static_cast<int>(kMaxStates) * kStateDim + kMaxCalibrationDim;

/// Columns of one state (or of the calibration) in the prior.
struct PriorBlock {
  static constexpr std::uint8_t kCalibration = 255;
  std::uint8_t slot = 0;  ///< of the state, or kCalibration
  int dimension = 0;      ///< the state's first 6 or 15 columns, or the calibration's
  int offset = 0;         ///< first column in H and b
  BodyState reference;    ///< unused for the calibration, whose reference the smoother keeps
};

class Prior {
 public:
  Prior();

  void clear();
  [[nodiscard]] bool empty() const { return dimension_ == 0; }
  [[nodiscard]] int dimension() const { return dimension_; }
  [[nodiscard]] const FixedVector<PriorBlock, kMaxStates + 1>& blocks() const { return blocks_; }
  [[nodiscard]] bool touches(std::uint8_t slot) const;

  MatrixMap H();
  VectorMap b();

  /// Starts a new set of blocks.
  void begin();
  /// Appends a block behind the others. At most kMaxStates and the calibration.
  void addBlock(std::uint8_t slot, int dimension, const BodyState& reference);
  /// After the last block: H and b take their size and are zeroed (in memory that is there already).
  void allocate();

 private:
  FixedVector<PriorBlock, kMaxStates + 1> blocks_;
  int dimension_ = 0;
  std::vector<double> h_;
  std::vector<double> b_;
};

}  // namespace swiftlet
