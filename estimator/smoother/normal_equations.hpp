#pragma once
// The reduced normal equations of one Gauss-Newton step: H d = -g over calibration, extra states and body
// states, with all structureless landmarks eliminated.
//
// Landmarks enter as Schur complements over 6 x 6 pose blocks (padded to 8 rows, so that a column fills two
// vector registers), which are scattered into the dense matrix once at the end.
// Shapes: H is n x n, g is n x 1, n = dimension() <= kMaxSystemDim; only the lower triangle of H is used.
// Columns are the error states of state.hpp and extra_states.hpp. Jacobians are taken at
// RigPose::linearization, residuals at the values. Memory: about 2.9 MiB, reserved by the constructor. Cost
// of a landmark: linear in its observations to linearize, quadratic in the states that see it to eliminate;
// both in vector lanes (landmark_block.hpp). Source: Triggs et al., "Bundle Adjustment - A Modern Synthesis",
// 1999, section 6.

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "estimator/smoother/calibration_columns.hpp"
#include "estimator/smoother/cholesky.hpp"
#include "estimator/smoother/eliminated_point.hpp"
#include "estimator/smoother/imu_factor.hpp"
#include "estimator/smoother/linear_factor.hpp"
#include "estimator/smoother/padded_block.hpp"
#include "estimator/smoother/prior.hpp"
#include "estimator/smoother/state.hpp"
#include "estimator/smoother/vision_factor.hpp"

namespace swiftlet {

class NormalEquations {
 public:
  NormalEquations();
  ~NormalEquations();

  /// Starts a system: calibration first, then all variables with an `offset`.
  void begin(const CalibrationLayout& calibration, int dimension);

  [[nodiscard]] int dimension() const { return dimension_; }
  /// Cost of the factors added so far, without the prior: half the sum of whitened squares, robust for
  /// observations.
  [[nodiscard]] double cost() const { return cost_; }
  MatrixMap H();
  VectorMap g();
  /// Exchanges the memory of the matrix for other memory of alignedMapSize(kMaxSystemDim), so that a factor
  /// can be kept without copying. H() is invalid until begin().
  void swapMatrix(std::vector<double>& memory) { h_.swap(memory); }

  /// Adds a motion factor between two states with all 15 columns. The gyro intrinsics' columns, if the factor
  /// has any, start at `gyro_offset`.
  void addMotion(const MotionFactor& factor, const WindowState& i, const WindowState& j, int gyro_offset = 0);

  /// Adds information 1 / sigma^2 on the three columns of a state from `first` on. `residual` is their value
  /// minus the reference; `residual` and `sigma` have the unit of the columns.
  void addDiagonal(const WindowState& state, int first, const Eigen::Vector3d& residual, double sigma);

  /// A small factor over any variables, each column at most once.
  void addFactor(const LinearFactor& factor);

  /// Eliminates a landmark; `eliminated`, unless null, receives the data for its back-substitution. False if
  /// it constrains nothing (fewer than two states, or not in front of a camera).
  bool addLandmark(const LandmarkViews& views, const LandmarkPoint& point,
                   const std::array<WindowState, kMaxStates>& states, EliminatedPoint* eliminated = nullptr);

  /// Adds the views of an explicit landmark with columns from `offset` on, with respect to its position (m,
  /// world).
  void addExplicitLandmark(const LandmarkViews& views, const Eigen::Vector3d& position, int offset,
                           const std::array<WindowState, kMaxStates>& states);

  /// Scatters the pose blocks into the lower triangle of H; call once after all factors.
  void finish(const std::array<WindowState, kMaxStates>& states);

 private:
  void addStates(const std::array<WindowState, kMaxStates>& states);

  [[nodiscard]] PaddedBlock& block(std::size_t slot_i, std::size_t slot_j) {
    return blocks_[slot_i * kMaxStates + slot_j];
  }

  CalibrationLayout calibration_;
  int dimension_ = 0;
  double cost_ = 0;
  std::vector<double> h_;
  std::vector<double> g_;
  std::unique_ptr<LandmarkBlock> landmark_;
  std::vector<PaddedBlock> blocks_;  // [slot_i][slot_j], used where offset_i >= offset_j
  std::array<std::array<double, kPoseDim>, kMaxStates> pose_gradient_{};
  std::array<bool, kMaxStates> touched_{};
};

}  // namespace swiftlet
