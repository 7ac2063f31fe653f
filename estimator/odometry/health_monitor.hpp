#pragma once
// What the estimate may be used for: the rules that turn a frame's figures into `Health`.
//
//  initializing  the first 9 frames of an epoch, in which tilt and velocity settle
//  good          25 accepted sightings, an image of every camera of the rig, none accepted over 0.3 s ago
//  degraded      a camera or IMU samples missing, fewer sightings, or coasting on the IMU for less than
//                the limit
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

  void reset();

  /// After a solve. `imu_missing`: samples were missing since the last frame.
  Health update(const TrackedFrame& frame, const FrameStatistics& statistics, std::size_t cameras,
                bool imu_missing, std::uint64_t frames_in_epoch);

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
};

}  // namespace swiftlet
