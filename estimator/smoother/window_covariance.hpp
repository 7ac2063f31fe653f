#pragma once
// Covariances of the window from the factor of its last solve, which outlives the system.
//
// covariance(a, b) = Y_a^T Y_b with Y = L^-1 of the columns asked for, times the pose variance factor where
// images decide: poses, calibration, landmarks and planes. Velocity and biases, the IMU's, go without. Error
// states as in state.hpp and extra_states.hpp. Memory: 2.8 MiB, reserved by the constructor. Cost: a
// triangular solve a column.

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

  /// Takes the factor L out of the system, and notes where the variables stand in it.
  void take(NormalEquations& system, WindowProblem& problem);
  [[nodiscard]] MatrixMap factor() { return alignedMap(factor_, dimension_); }

  /// Of what is given out from now on (track_correlation.hpp).
  void setPoseVarianceFactor(double factor) { factor_of_poses_ = factor; }

  /// Of the newest state of the last solve.
  [[nodiscard]] const Matrix15d& newest() const { return newest_; }
  /// Of T_i_j = T_world_i^-1 T_world_j, in j's error state (phi, p of T_i_j, rotation on the right), from the
  /// joint marginal. False for a state that was not in the last solve.
  [[nodiscard]] bool relative(const WindowState& i, const WindowState& j,
                              Eigen::Matrix<double, 6, 6>& covariance);
  /// Of what is estimated of the calibration, all in its columns (calibration_columns.hpp); false before a
  /// solve.
  [[nodiscard]] bool calibration(int dimension, CalibrationMatrix& covariance);
  /// Zero for one that was not in the last solve.
  [[nodiscard]] Eigen::Matrix3d of(const ExtraState& extra);
  /// A keyframe with its covariance. Velocity and biases of a pose-only one keep the covariance with which
  /// they left; their correlation with the pose, which has been refined since, is not known any more.
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
