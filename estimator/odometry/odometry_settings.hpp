#pragma once
// Settings that users may need; all other numbers are named constants with their reasons.

#include "estimator/messages/track_noise.hpp"

namespace swiftlet {

struct OdometrySettings {
  int max_features = 300;                 ///< features tracked at once, at most kMaxFeatures
  double horizon = 30.0;                  ///< s, fixed lag: states older than this leave the window
  double pixel_sigma = kTrackPixelSigma;  ///< px, standard deviation of a tracked coordinate
  /// Factors on the calibration's white-noise densities. Calibrations are made at rest; vibration, scale
  /// errors and misalignment add to the noise in flight. 1 if the densities already hold in flight.
  double gyro_inflation = 1.5;
  double accel_inflation = 5.0;
  bool estimate_time_offset = false;
  bool estimate_extrinsics = false;
  bool estimate_gyro = true;
  bool use_stereo = true;  ///< false: camera 0 only
  /// Limits of the vehicle; health is not good if the estimate exceeds them.
  double max_speed = 30;         ///< m/s
  double max_acceleration = 50;  ///< m/s^2, over half a second
  /// Tie landmarks to the planes that the mesher finds.
  bool regularity_enabled = false;
  double plane_point_sigma =
      0.01;  ///< m, standard deviation of a point's distance from its plane: posters, plaster, mats
};

}  // namespace swiftlet
