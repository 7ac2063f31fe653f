#pragma once
// What the estimate may be used for: the rules that turn a frame's figures into `Health`.
//
//  initializing  until the first frames have settled tilt and velocity
//  good          enough accepted sightings from every camera of the rig, none of them old
//  degraded      one camera, few sightings, or coasting on the IMU for less than the limit
//  failed        coasting longer than the limit

#include <cstdint>

#include "estimator/messages/nav_state.hpp"
#include "estimator/messages/odometry_output.hpp"
#include "estimator/messages/tracked_frame.hpp"

namespace swiftlet {

class HealthMonitor {
 public:
  void reset();

  /// After a solve.
  Health update(const TrackedFrame& frame, const FrameStatistics& statistics, std::size_t cameras,
                std::uint64_t frames_in_epoch);

  /// The health after the last update.
  [[nodiscard]] Health health() const { return health_; }
  /// The health at a later stamp without a new frame: images that stay away degrade it.
  [[nodiscard]] Health at(Stamp stamp) const;
  [[nodiscard]] double secondsWithoutImage(Stamp stamp) const;

 private:
  Health health_ = Health::kInitializing;
  bool has_image_ = false;
  Stamp last_accepted_;
};

}  // namespace swiftlet
