#pragma once
// One camera's lens without a first guess, in one of the two models.
//
// Focal lengths from a narrow to the widest lens are tried without distortion: with each, the board's pose in
// every view follows (board_pose.hpp), and the one that predicts the corners best is where the bundle begins.
// First focal length, centre and one term of distortion are solved robustly, then all.

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <vector>

#include "drivers/target/calibration_target.hpp"
#include "firmware_host/lab/calibrate/cameras/camera_moments.hpp"

namespace swiftlet {

struct LensFit {
  CameraModel lens;
  double sigma = 0;  ///< px per axis, without outliers
  /// Mean square per axis [px^2] over all corners, each view posed by itself; corners beyond four sigma count
  /// as four sigma.
  [[nodiscard]] double meanSquare(const CalibrationTarget& target, std::size_t camera,
                                  const std::vector<const Moment*>& moments, double clip_sigma) const;
};

/// `size`: width and height [px]. Nothing where the model cannot describe the lens.
[[nodiscard]] std::optional<LensFit> fitLens(const CalibrationTarget& target, CameraKind kind,
                                             std::size_t camera, const Eigen::Vector2i& size,
                                             const std::vector<const Moment*>& moments);

}  // namespace swiftlet
