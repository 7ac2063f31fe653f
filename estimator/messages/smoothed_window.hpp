#pragma once
// The smoother's window after a solve: what the tracker predicts from and the mesher draws.

#include <Eigen/Core>
#include <cstdint>

#include "estimator/core/fixed_vector.hpp"
#include "estimator/core/limits.hpp"
#include "estimator/messages/calibration_estimate.hpp"
#include "estimator/messages/nav_state.hpp"
#include "estimator/messages/scan_motion.hpp"
#include "estimator/messages/tracked_frame.hpp"

namespace swiftlet {

struct WindowPose {
  Stamp stamp;
  std::uint64_t frame_index = 0;
  bool keyframe = false;
  SE3 T_world_body;
  ScanMotion scan;  ///< while a rolling shutter's rows were read; else nothing
};

struct WindowLandmark {
  TrackId id = 0;
  Eigen::Vector3d p_world = Eigen::Vector3d::Zero();  ///< m
  double inverse_depth_sigma = 0;                     ///< 1/m, along the first sighting's ray
  int sightings = 0;                                  ///< states of the window that see it
};

/// A plane that landmarks of the window are tied to: n . p = distance, world.
struct WindowPlane {
  std::uint64_t id = 0;  ///< the mesher's (plane_report.hpp)
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();
  double distance = 0;  ///< m
  /// Of (normal, distance): rank 3. The variance of the plane's height at a point p is q^T C q with
  /// q = (p, -1).
  Eigen::Matrix4d covariance = Eigen::Matrix4d::Zero();
  int points = 0;  ///< tied to it
};

struct SmoothedWindow {
  std::uint32_t epoch = 0;
  std::uint32_t timeline = 0;  ///< TrackedFrame::timeline of the frame it comes from
  bool started = false;  ///< false: no state yet in this epoch, nothing below but the calibration counts
  NavState newest;       ///< stamp on the IMU's clock
  CalibrationEstimate calibration;
  FixedVector<WindowPose, kMaxStates> poses;  ///< in order of time
  FixedVector<WindowLandmark, kMaxLandmarks> landmarks;
  FixedVector<WindowPlane, kMaxPlanes> planes;  ///< those that the last solve has determined
};

}  // namespace swiftlet
