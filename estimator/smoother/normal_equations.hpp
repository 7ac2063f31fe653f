#pragma once
// The reduced normal equations of one Gauss-Newton step: H d = -g over calibration, extra states and body
// states, with every structureless landmark already eliminated.
//
// Landmarks enter as Schur complements over 6 x 6 pose blocks (padded to 8 rows so that a column is
// two vector registers), which are scattered into the dense matrix once at the end.
// Shapes: H is n x n, g is n x 1, n = dimension() <= kMaxSystemDim; of H the lower triangle counts.
// Columns are the error states of state.hpp and extra_states.hpp. Jacobians at the linearization, residuals
// at the values. Memory: about 2.9 MiB, reserved by the constructor. Cost of a landmark: linear in its
// sightings to linearize, quadratic in the states that see it to eliminate; both in vector lanes. While the
// calibration is estimated, linearization goes view by view. Source: Triggs et al., "Bundle Adjustment - A
// Modern Synthesis", 1999, section 6.

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "estimator/smoother/cholesky.hpp"
#include "estimator/smoother/eliminated_point.hpp"
#include "estimator/smoother/imu_factor.hpp"
#include "estimator/smoother/linear_factor.hpp"
#include "estimator/smoother/prior.hpp"
#include "estimator/smoother/state.hpp"
#include "estimator/smoother/vision_factor.hpp"

namespace swiftlet {

/// What the normal equations need to know of the calibration that is being estimated.
struct CalibrationLayout {
  bool time_offset = false;
  bool extrinsics = false;
  std::size_t cameras = 0;

  [[nodiscard]] int dimension() const {
    return int{time_offset} + (extrinsics ? kPoseDim * static_cast<int>(cameras) : 0);
  }
  [[nodiscard]] int extrinsicOffset(std::size_t camera) const {
    return int{time_offset} + kPoseDim * static_cast<int>(camera);
  }
};

class NormalEquations {
 public:
  NormalEquations();

  /// Starts a system: calibration first, then whatever has an `offset`.
  void begin(const CalibrationLayout& calibration, int dimension);

  [[nodiscard]] int dimension() const { return dimension_; }
  /// Of the factors added so far: half the sum of whitened squares, robust for sightings. Not the prior's.
  [[nodiscard]] double cost() const { return cost_; }
  MatrixMap H();
  VectorMap g();
  /// Gives the matrix's memory away, for other memory of alignedMapSize(kMaxSystemDim): until begin()
  /// there is no H. A factor is kept in this way without being copied.
  void swapMatrix(std::vector<double>& memory) { h_.swap(memory); }

  /// Both states have all 15 columns.
  void addMotion(const MotionFactor& factor, const WindowState& i, const WindowState& j);

  /// Information 1 / sigma^2 on three columns of one state, from `first` on: `residual` is their value
  /// minus its reference, in their unit, as is `sigma`.
  void addDiagonal(const WindowState& state, int first, const Eigen::Vector3d& residual, double sigma);

  /// Any small factor, over any variables, each column at most once.
  void addFactor(const LinearFactor& factor);

  /// Eliminates a landmark; `eliminated`, unless null, gets what its back-substitution needs. False when
  /// it does not constrain anything (fewer than two states, or not in front of a camera at the
  /// linearization point).
  bool addLandmark(const Landmark& landmark, RigPoses poses, const std::array<SE3, kMaxCameras>& T_body_cam,
                   const std::array<WindowState, kMaxStates>& states, EliminatedPoint* eliminated = nullptr);

  /// Scatters the pose blocks; call once after all factors. Fills the lower triangle of H.
  void finish(const std::array<WindowState, kMaxStates>& states);

 private:
  static constexpr std::size_t kRows = 8;  // rows of a padded pose block
  using PoseBlock = std::array<double, kRows * kPoseDim>;

  /// A state that saw an eliminated landmark, and its Y (landmark_lanes.hpp) in padded columns.
  struct EliminatedPose {
    std::uint32_t slot = 0;
    alignas(32) double y[3][kRows];
  };

  bool addLandmarkInLanes(const Landmark& landmark, RigPoses poses,
                          const std::array<SE3, kMaxCameras>& T_body_cam,
                          const std::array<WindowState, kMaxStates>& states, EliminatedPoint* kept);
  bool addLandmarkWithCalibration(const Landmark& landmark, RigPoses poses,
                                  const std::array<SE3, kMaxCameras>& T_body_cam,
                                  const std::array<WindowState, kMaxStates>& states, EliminatedPoint* kept);
  /// -Y_i Y_j^T for each pair of different states.
  void subtractPairs(std::span<const EliminatedPose> poses,
                     const std::array<WindowState, kMaxStates>& states);

  [[nodiscard]] PoseBlock& block(std::size_t slot_i, std::size_t slot_j) {
    return blocks_[slot_i * kMaxStates + slot_j];
  }

  CalibrationLayout calibration_;
  int dimension_ = 0;
  double cost_ = 0;
  std::vector<double> h_;
  std::vector<double> g_;
  std::vector<PoseBlock> blocks_;  // [slot_i][slot_j], used where offset_i >= offset_j
  std::array<std::array<double, kPoseDim>, kMaxStates> pose_gradient_{};
  std::array<bool, kMaxStates> touched_{};
};

}  // namespace swiftlet
