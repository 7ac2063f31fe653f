#pragma once
// Predictions for a frame from the rest of the estimator, before its images are processed.

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>

#include "estimator/core/fixed_vector.hpp"
#include "estimator/core/limits.hpp"
#include "estimator/geometry/se3.hpp"
#include "estimator/messages/scan_motion.hpp"
#include "estimator/messages/tracked_frame.hpp"

namespace swiftlet {

struct PredictedLandmark {
  TrackId id = 0;
  std::array<bool, kMaxCameras> visible{};           ///< projects into that camera's image
  std::array<Eigen::Vector2f, kMaxCameras> pixel{};  ///< valid where visible
  float gate = 10.0F;                                ///< px: search radius (about 3 sigma)
};

struct FrontendPrediction {
  bool has_rotation = false;
  /// Body at this frame to body at the previous one: R_prev_cur (gyro, bias removed).
  Eigen::Quaterniond R_body_prev_body_cur = Eigen::Quaterniond::Identity();
  /// Motion during this frame's rows, for a rolling shutter.
  ScanTurn scan;
  FixedVector<PredictedLandmark, kMaxLandmarks> landmarks;
  /// Present if extrinsics are estimated: their current values, and the sigma of one camera relative to the
  /// other.
  bool has_extrinsics = false;
  std::array<SE3, kMaxCameras> T_body_cam;
  double stereo_rotation_sigma = 0;  ///< rad
};

}  // namespace swiftlet
