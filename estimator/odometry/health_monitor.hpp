#pragma once
// What the estimate may be used for: the rules that turn a frame's figures into `Health`.
//
//  initializing  until the 10th accepted image of an epoch: tilt and velocity settle
//  good          25 accepted sightings, an image of every camera of the rig, none accepted over 0.3 s ago
//  degraded      a camera missing, fewer sightings, or coasting on the IMU for less than the limit; samples
//                missing, or coasting for more than 0.3 s, and the 9 accepted images after it, in which the
//                state that drifted settles again
//  failed        no accepted image (8 sightings) for 3 s; the next accepted image ends it
// Sightings by both cameras count once. Residuals and covariance are not looked at. No memory, O(1).

#include <cstdint>

#include "estimator/messages/nav_state.hpp"
#include "estimator/messages/odometry_output.hpp"
#include "estimator/messages/tracked_frame.hpp"

namespace swiftlet {

class HealthMonitor {
 public:
  /// s without an accepted image before "good" ends.
  static constexpr double kGoodAge = 0.3;
  /// s without an accepted image after which a new epoch begins, unless the image shows what is known.
  static constexpr double kLongCoast = 1.0;
  /// A frame with fewer accepted sightings is not accepted.
  static constexpr int kMinSightings = 8;
  /// With fewer it is not good.
  static constexpr int kNominalSightings = 25;

  void reset();

  /// After a solve. `imu_missing`: samples were missing since the last frame.
  Health update(const TrackedFrame& frame, const FrameStatistics& statistics, std::size_t cameras,
                bool imu_missing, bool first_of_epoch);

  /// The health after the last update.
  [[nodiscard]] Health health() const { return health_; }
  /// The health at a later stamp without a new frame: images that stay away degrade it.
  [[nodiscard]] Health at(Stamp stamp) const;
  /// The same for who has only the last verdict and the stamp of the last accepted image.
  [[nodiscard]] static Health aged(Health health, Stamp last_accepted, Stamp stamp);
  /// Of the epoch; meaningful after its first update.
  [[nodiscard]] Stamp lastAccepted() const { return last_accepted_; }
  [[nodiscard]] double secondsWithoutImage(Stamp stamp) const;

 private:
  Health health_ = Health::kInitializing;
  bool has_image_ = false;
  Stamp last_accepted_;
  int settling_ = 0;  ///< accepted images until the state has settled
};

}  // namespace swiftlet
