#pragma once
// Lenses of one or two cameras and the transform between them, from views of a board.
//
// 1. Views of both cameras at one moment are paired. The 30 moments that differ most give each camera a first
//    lens in both models (lens_start.hpp).
// 2. The model: both have eight parameters, so the Bayesian information criterion compares n ln(mean square)
//    of the same corners. Kannala-Brandt is used if it is better by more than 10 (very strong evidence,
//    Kass, Raftery 1995), otherwise the pinhole model.
// 3. At most 200 moments that are most informative about lenses and transform together are chosen
//    (camera_moments.hpp), and one bundle of both cameras is solved without outliers (camera_bundle.hpp).
// 4. Corner noise is estimated from the residuals; covariances follow from it. Every other view alone gives
// the
//    lenses again: halves that differ by more than their noise reveal an error of the model.
// 5. Reasons (camera_verdict.cpp) say why the result cannot be trusted. Limits are in radians (px per focal
//    length) or sigmas. A board that is not flat is not modelled; bends appear as corner noise and in the
//    halves.
// The scale comes from the board alone: a wrong board size is noticed only if a baseline is given. A rolling
// shutter is not modelled here (imu_camera does): the rig must be held still for each image. Equal views give
// equal bytes. Cost: some 10 s for 1200 moments of two cameras; memory some 100 MB.

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <functional>
#include <string>
#include <vector>

#include "drivers/target/board_view.hpp"
#include "drivers/target/calibration_target.hpp"
#include "estimator/core/limits.hpp"
#include "firmware_host/lab/calibrate/cameras/camera_bundle.hpp"
#include "firmware_host/lab/calibrate/cameras/camera_moments.hpp"
#include "firmware_host/lab/calibrate/cameras/camera_solution.hpp"

namespace swiftlet {

struct CameraInput {
  CalibrationTarget target;
  std::vector<BoardView> views;  ///< in any order; those without corners may be omitted
  std::size_t camera_count = 1;
  std::array<Eigen::Vector2i, kMaxCameras> image_size{Eigen::Vector2i::Zero(), Eigen::Vector2i::Zero()};
  double told_baseline = 0;  ///< m, measured by hand; 0: not measured
};

/// `progress`: called with the finished share, 0 to 1. If a camera's model has width 0, its lens was not
/// found; the reasons say why.
[[nodiscard]] CameraSolution calibrateCameras(const CameraInput& input,
                                              const std::function<void(double)>& progress = {});

/// Inputs of the verdict besides the solution. Private to this folder.
struct CameraEvidence {
  const CameraInput* input = nullptr;
  const CameraBundle* bundle = nullptr;           ///< solved
  double stamp_difference = 0;                    ///< s
  std::array<double, kMaxCameras> alone_sigma{};  ///< px, of each camera's first lens
  std::array<Eigen::Matrix<double, 8, 8>, kMaxCameras> half_covariance{};  ///< of one half
};

void addCameraReasons(const CameraEvidence& evidence, CameraSolution& solution);

}  // namespace swiftlet
