#pragma once
// Covariances of the window from the factor of its last solve, which outlives the system.
//
// covariance(a, b) = Y_a^T Y_b with Y = L^-1 of the requested columns. Variables determined by images (poses,
// calibration, landmarks, planes) are multiplied by the pose variance factor; velocity and biases, determined
// by the IMU, are not. Error states as in state.hpp and extra_states.hpp. Memory: 2.8 MiB, reserved by the
// constructor. Cost: one triangular solve per column.

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "estimator/messages/odometry_output.hpp"
#include "estimator/smoother/normal_equations.hpp"
#include "estimator/smoother/window_problem.hpp"

namespace swiftlet {

using CalibrationMatrix =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxCalibrationDim, kMaxCalibrationDim>;

class WindowCovariance {
 public:
  WindowCovariance();

  /// Takes the factor L out of the system and records the columns of the variables in it.
  void take(NormalEquations& system, WindowProblem& problem);
  [[nodiscard]] MatrixMap factor() { return alignedMap(factor_, dimension_); }

  /// Sets the pose variance factor for later outputs (track_correlation.hpp).
  void setPoseVarianceFactor(double factor) { factor_of_poses_ = factor; }

  /// Covariance of the newest state of the last solve.
  [[nodiscard]] const Matrix15d& newest() const { return newest_; }
  /// Covariance of T_i_j = T_world_i^-1 T_world_j, in j's error state (phi, p of T_i_j, rotation on the
  /// right), from the joint marginal. False for a state that was not in the last solve.
  [[nodiscard]] bool relative(const WindowState& i, const WindowState& j,
                              Eigen::Matrix<double, 6, 6>& covariance);
  /// Covariance of the estimated calibration, in its columns (calibration_columns.hpp); false before a solve.
  [[nodiscard]] bool calibration(int dimension, CalibrationMatrix& covariance);
  /// Covariance of an extra state; zero if it was not in the last solve.
  [[nodiscard]] Eigen::Matrix3d of(const ExtraState& extra);
  /// A keyframe with its covariance. Velocity and biases of a pose-only keyframe keep the covariance with
  /// which they were marginalized; their correlation with the pose, which was refined since then, is unknown.
  [[nodiscard]] KeyframeState record(const WindowState& state);

 private:
  void solveColumns(int offset, int count, std::vector<double>& columns);

  std::vector<double> factor_;
  std::vector<double> columns_i_;
  std::vector<double> columns_j_;
  int dimension_ = 0;
  double factor_of_poses_ = 1;
  Matrix15d newest_ = Matrix15d::Zero();
};

}  // namespace swiftlet
