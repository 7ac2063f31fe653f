#pragma once
// Solves lenses, the transform between two cameras and a board pose per view together.
//
// Minimizes the squares of (seen - predicted) pixels over
//   globals: of each camera fx fy cx cy and four distortion terms; of two cameras T_cam1_cam0 (rotation
//            vector on the right, then translation),
//   views:   T_cam0_board, in the same form,
// by Levenberg-Marquardt on the globals after the views are eliminated (Schur complement). The same blocks
// give the information on the globals, used for choosing views and for covariances. Cost of a step: 2 x 30^2
// multiplications per corner; 20 ms for 100 views of two cameras. Threads: one. Source: Triggs, McLauchlan,
// Hartley, Fitzgibbon, "Bundle Adjustment - A Modern Synthesis", 2000, section 6.

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "drivers/target/board_view.hpp"
#include "drivers/target/calibration_target.hpp"
#include "estimator/camera/camera_model.hpp"
#include "estimator/core/limits.hpp"
#include "estimator/core/stamp.hpp"
#include "estimator/geometry/se3.hpp"

namespace swiftlet {

struct BundleCorner {
  std::size_t camera = 0;
  int id = 0;
  Eigen::Vector3d point = Eigen::Vector3d::Zero();  ///< on the board [m]
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  bool used = true;
};

struct BundleView {
  Stamp stamp;
  SE3 T_cam0_board;
  std::vector<BundleCorner> corners;

  void add(const CalibrationTarget& target, std::size_t camera, const BoardView& view);
};

class CameraBundle {
 public:
  using Information = Eigen::MatrixXd;

  std::size_t camera_count = 1;
  std::array<CameraModel, kMaxCameras> lens;
  SE3 T_cam1_cam0;
  std::vector<BundleView> views;

  [[nodiscard]] int globalCount() const { return camera_count == 2 ? 22 : 8; }
  /// Distortion terms that are solved for: one at first, then all four.
  enum class Terms : std::uint8_t { kOne, kAll };

  /// Iterates until convergence. `robust_scale` [px]: of the Cauchy weights; 0: plain squares. False: no
  /// minimum found.
  bool solve(Terms terms, double robust_scale);

  /// seen - predicted; false if the lens does not reach the point.
  [[nodiscard]] bool residual(const BundleView& view, const BundleCorner& corner, Eigen::Vector2d& r) const;
  /// px, of all residuals, used or not; infinite if a corner has none. 0 without corners.
  [[nodiscard]] double medianResidual() const;
  /// Information on the globals with the board's pose eliminated, for corners of 1 px sigma.
  [[nodiscard]] Information information(const BundleView& view) const;
  [[nodiscard]] Information information() const;

  /// Solves robustly, then removes corners beyond four sigma until none changes. Views with fewer than six
  /// remaining corners are removed. False: failed. `sigma`: of a corner's pixel, per axis.
  bool solveWithoutOutliers(double& sigma);

 private:
  struct Block;

  void addCorner(const BundleView& view, const BundleCorner& corner, double robust_scale, Block& block) const;
  [[nodiscard]] Block blockOf(const BundleView& view, double robust_scale) const;
  [[nodiscard]] double cost(double robust_scale) const;
  [[nodiscard]] CameraBundle moved(const Eigen::VectorXd& globals,
                                   const std::vector<Eigen::Matrix<double, 6, 1>>& poses) const;
};

}  // namespace swiftlet
