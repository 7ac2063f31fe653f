#pragma once
// The data of an eliminated landmark that are needed for its own step once the step of the states is known.
//
// With B_i, c and C = L L^T as in landmark_block.hpp, Y_i = B_i L^-T and z = L^-1 c, the step of the point is
//   dp = -C^-1 (c + sum_i B_i^T dx_i) = -L^-T (z + sum_i Y_i^T dx_i)       (back-substitution),
// with i over the states that see it and, if estimated, the columns of the calibration. Units: those of the
// point (tangent coordinates of the bearing, inverse depth). Y is in single precision: seven digits suffice
// for a step that the next one corrects. No allocation. Memory: 2.6 KiB per point. Cost: three multiply-adds
// of eight lanes per state. Source: Triggs et al., "Bundle Adjustment - A Modern Synthesis", 1999, section
// 6.1.

#include <Eigen/Core>
#include <array>
#include <cstdint>

#include "estimator/smoother/calibration_columns.hpp"
#include "estimator/smoother/cholesky.hpp"
#include "estimator/smoother/padded_block.hpp"
#include "estimator/smoother/state.hpp"

namespace swiftlet {

/// L of C = L L^T, 3 x 3, where C includes the prior on the inverse depth; the diagonal is inverted.
struct PointFactor {
  double i00, i11, i22;
  double l10, l20, l21;

  /// False if C is not positive definite (or NaN).
  [[nodiscard]] bool compute(Eigen::Matrix3d C);
  /// x := L^-1 x, for one vector or one per lane.
  template <typename T>
  void solve(T (&x)[3]) const {
    x[0] = x[0] * i00;
    x[1] = (x[1] - l10 * x[0]) * i11;
    x[2] = (x[2] - l20 * x[0] - l21 * x[1]) * i22;
  }
  /// x := L^-T x.
  void solveTransposed(Eigen::Vector3d& x) const {
    x[2] = x[2] * i22;
    x[1] = (x[1] - l21 * x[2]) * i11;
    x[0] = (x[0] - l10 * x[1] - l20 * x[2]) * i00;
  }
};

class LandmarkBlock;

/// A step of the whole system, prepared once for the back-substitution of all points.
class StepOfStates {
 public:
  /// `dx`: columns as in `states`, calibration first. Slots without a state can have any offset.
  StepOfStates(const VectorMap& dx, const std::array<WindowState, kMaxStates>& states, int calibration);

 private:
  friend class EliminatedPoint;
  /// By slot; zero after the six pose rows.
  alignas(32) std::array<std::array<float, kPaddedRows>, kMaxStates> pose_{};
  std::array<float, kMaxCalibrationDim> calibration_{};
};

class EliminatedPoint {
 public:
  /// Stores the data of a landmark that was just eliminated.
  void keep(const LandmarkBlock& landmark);

  /// 1/m, standard deviation with the states held fixed.
  [[nodiscard]] double inverseDepthSigma() const { return L_.i22; }

  /// The step of the point for a step of the states.
  [[nodiscard]] Eigen::Vector3d step(const StepOfStates& states) const;

 private:
  struct StateColumns {
    std::uint32_t slot;
    float Y[3][kPaddedRows];  ///< by columns; zero after the six pose rows
  };

  PointFactor L_{};
  Eigen::Vector3d z_ = Eigen::Vector3d::Zero();
  std::array<StateColumns, kMaxStates> states_;
  std::size_t count_ = 0;
  int calibration_dimension_ = 0;
  Eigen::Matrix<float, kMaxCalibrationDim, 3> Y_calibration_;
};

}  // namespace swiftlet
