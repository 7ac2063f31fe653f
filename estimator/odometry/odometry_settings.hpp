#pragma once
// The settings a user may need; every other number is a named constant beside its reason.

#include "estimator/messages/track_noise.hpp"

namespace swiftlet {

struct OdometrySettings {
  int max_features = 300;                 ///< features tracked at once, at most kMaxFeatures
  double horizon = 30.0;                  ///< s of fixed lag: no state older than this stays in the window
  double pixel_sigma = kTrackPixelSigma;  ///< px, noise of one tracked coordinate
  /// Factors on the calibration's white-noise densities. A calibration is made at rest; in flight
  /// vibration, scale and misalignment come on top. 1 where the figures already hold in flight.
  double gyro_inflation = 1.5;
  double accel_inflation = 5.0;
  bool estimate_time_offset = false;
  bool estimate_extrinsics = false;
  bool estimate_gyro = true;
  bool use_stereo = true;  ///< false: camera 0 alone
  /// What the vehicle can do: an estimate beyond it is not good.
  double max_speed = 30;         ///< m/s
  double max_acceleration = 50;  ///< m/s^2, over half a second
  /// Ties landmarks to the planes that the mesher finds.
  bool regularity_enabled = false;
  double plane_point_sigma =
      0.01;  ///< m, by which a point of a wall is off its plane: posters, plaster, mats
};

}  // namespace swiftlet
