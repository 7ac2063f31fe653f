#pragma once
// Calibration of one or two cameras from views of a board.

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <string>
#include <vector>

#include "estimator/camera/camera_model.hpp"
#include "estimator/core/limits.hpp"
#include "estimator/core/stamp.hpp"
#include "estimator/geometry/se3.hpp"

namespace swiftlet {

/// px: corners of one detector share errors of some hundredths, which residuals do not show.
inline constexpr double kLeastCornerSigma = 0.02;

/// px: residual of a corner that the lens cannot project, so that losing a corner never improves a step.
inline constexpr double kNoPixel = 100;

/// A corner that was used, or removed as an outlier.
struct CornerResidual {
  std::size_t camera = 0;
  std::size_t view = 0;  ///< index into `views`
  int corner = 0;
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();     ///< seen
  Eigen::Vector2d residual = Eigen::Vector2d::Zero();  ///< seen - predicted [px]
  bool outlier = false;
};

struct SolvedView {
  Stamp stamp;
  SE3 T_cam0_board;  ///< by camera 1 alone where camera 0 has no corners: through T_cam1_cam0
};

struct SolvedCamera {
  using Covariance = Eigen::Matrix<double, 8, 8>;

  CameraModel model;
  Covariance covariance = Covariance::Zero();  ///< fx fy cx cy [px], then the four of the distortion
  std::string why_this_model;                  ///< in words, with the other model's value
  double rms = 0;                              ///< px per axis, without outliers
  /// The same lens from the even views, and from the odd ones.
  std::array<CameraModel, 2> halves;
};

struct CameraSolution {
  std::size_t camera_count = 0;
  std::array<SolvedCamera, kMaxCameras> camera;
  SE3 T_cam1_cam0;
  /// Of T_cam1_cam0: rotation vector [rad] then translation [m], as in R <- R Exp(phi), t <- t + dt.
  Eigen::Matrix<double, 6, 6> stereo_covariance = Eigen::Matrix<double, 6, 6>::Zero();
  double corner_sigma = 0;  ///< px per axis, from the residuals
  std::vector<SolvedView> views;
  std::vector<CornerResidual> corners;
  /// Why this cannot be trusted, one sentence each with its remedy; empty: good.
  std::vector<std::string> reasons;
  /// Those of `reasons` that a rolling shutter explains too: it is not modelled here.
  std::vector<std::string> rolling_reasons;
};

}  // namespace swiftlet
