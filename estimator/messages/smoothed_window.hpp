#pragma once
// The smoother's window after a solve, for prediction by the tracker and for the mesher.

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
  ScanMotion scan;  ///< motion while the rows of a rolling shutter were read; otherwise zero
};

struct WindowLandmark {
  TrackId id = 0;
  Eigen::Vector3d p_world = Eigen::Vector3d::Zero();  ///< m
  double inverse_depth_sigma = 0;                     ///< 1/m, along the ray of the first observation
  int sightings = 0;                                  ///< number of states of the window that observe it
};

/// A plane that landmarks of the window are tied to: n . p = distance, world.
struct WindowPlane {
  std::uint64_t id = 0;  ///< the mesher's (plane_report.hpp)
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();
  double distance = 0;  ///< m
  /// Covariance C of (normal, distance), of rank 3. The variance of the distance between plane and a point p
  /// is q^T C q with q = (p, -1).
  Eigen::Matrix4d covariance = Eigen::Matrix4d::Zero();
  int points = 0;  ///< number of tied landmarks
};

struct SmoothedWindow {
  std::uint32_t epoch = 0;
  std::uint32_t timeline = 0;  ///< TrackedFrame::timeline of the frame it comes from
  bool started = false;        ///< false: no state yet in this epoch, only the calibration is valid
  NavState newest;             ///< stamp on the IMU's clock
  CalibrationEstimate calibration;
  FixedVector<WindowPose, kMaxStates> poses;  ///< in order of time
  FixedVector<WindowLandmark, kMaxLandmarks> landmarks;
  FixedVector<WindowPlane, kMaxPlanes> planes;  ///< planes with enough information in the last solve
};

}  // namespace swiftlet
