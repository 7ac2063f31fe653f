#pragma once
// Finds one camera's lens without an initial guess, in one of the two models.
//
// Focal lengths from a narrow lens to the widest are tried without distortion: each gives the board's pose in
// every view (board_pose.hpp), and the focal length that predicts the corners best is the bundle's start.
// Focal length, centre and one distortion term are solved robustly first, then all terms.

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <vector>

#include "drivers/target/calibration_target.hpp"
#include "firmware_host/lab/calibrate/cameras/camera_moments.hpp"

namespace swiftlet {

struct LensStart {
  CameraModel lens;
  double sigma = 0;  ///< px per axis, without outliers
  /// Mean square per axis [px^2] over all corners, each view posed separately; larger residuals count as
  /// `clip_sigma` sigmas.
  [[nodiscard]] double meanSquare(const CalibrationTarget& target, std::size_t camera,
                                  const std::vector<const Moment*>& moments, double clip_sigma) const;
};

/// `size`: width and height [px]. Empty if the model cannot describe the lens.
[[nodiscard]] std::optional<LensStart> fitLens(const CalibrationTarget& target, CameraKind kind,
                                               std::size_t camera, const Eigen::Vector2i& size,
                                               const std::vector<const Moment*>& moments);

}  // namespace swiftlet
