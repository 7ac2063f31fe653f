#pragma once
// The settings a user may need; every other number is a named constant beside its reason.

namespace swiftlet {

struct OdometrySettings {
  int max_features = 200;      ///< features tracked at once, at most kMaxFeatures
  double horizon = 5.0;        ///< s of fixed lag: no state older than this stays in the window
  double pixel_sigma = 0.6;    ///< px, noise of one tracked coordinate
  double imu_inflation = 1.0;  ///< factor on the calibration's noise densities
  bool estimate_time_offset = false;
  bool estimate_extrinsics = false;
  bool use_stereo = true;  ///< false: camera 0 alone
};

}  // namespace swiftlet
