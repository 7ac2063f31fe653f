#pragma once
// What marginalized states left behind: a quadratic cost on the states that remain.
//
//   cost(d) = 1/2 d^T H d + b^T d,   d = x [-] reference, stacked over the prior's blocks.
// For frozen states the reference is their first estimate. The Hessian form is kept in double
// precision, which the sqrt-form's advantage (float) does not concern.

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
  std::uint8_t slot = 0;
  int dimension = 0;
  int offset = 0;
  BodyState reference;
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

  /// Starts a new set of blocks; H and b are zeroed and take the new size.
  void begin();
  void addBlock(std::uint8_t slot, int dimension, const BodyState& reference);
  void allocate();

 private:
  FixedVector<PriorBlock, kMaxStates + 1> blocks_;
  int dimension_ = 0;
  std::vector<double> h_;
  std::vector<double> b_;
};

}  // namespace swiftlet
