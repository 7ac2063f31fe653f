#include "estimator/odometry/health_monitor.hpp"

#include <algorithm>

namespace swiftlet {
namespace {

constexpr int kSettlingImages = 10;
// Coasting position error grows with the cube of time: after 3 s it is metres.
constexpr double kCoastLimit = 3.0;  // s

}  // namespace

void HealthMonitor::reset() {
  health_ = Health::kInitializing;
  has_image_ = false;
  settling_ = kSettlingImages;
}

Health HealthMonitor::update(const TrackedFrame& frame, const FrameStatistics& statistics,
                             std::size_t cameras, bool imu_missing, bool first_of_epoch) {
  const int sightings = statistics.inliers_mono + statistics.inliers_stereo;
  if (first_of_epoch) settling_ = kSettlingImages;
  const double without_image = secondsWithoutImage(frame.stamp);
  if (imu_missing || without_image > kGoodAge) settling_ = std::max(settling_, kSettlingImages);
  if (sightings >= kMinSightings || first_of_epoch) {
    last_accepted_ = frame.stamp;
    has_image_ = true;
    settling_ = std::max(settling_ - 1, 0);
  }
  bool all_cameras = true;
  for (std::size_t c = 0; c < cameras; ++c) all_cameras = all_cameras && frame.camera_present[c];
  if (first_of_epoch || (health_ == Health::kInitializing && settling_ > 0)) {
    health_ = Health::kInitializing;
  } else {
    health_ =
        sightings >= kNominalSightings && all_cameras && settling_ == 0 ? Health::kGood : Health::kDegraded;
  }
  health_ = at(frame.stamp);
  return health_;
}

double HealthMonitor::secondsWithoutImage(Stamp stamp) const {
  return has_image_ ? (stamp - last_accepted_).seconds() : 0.0;
}

Health HealthMonitor::at(Stamp stamp) const {
  return has_image_ ? aged(health_, last_accepted_, stamp) : health_;
}

Health HealthMonitor::aged(Health health, Stamp last_accepted, Stamp stamp) {
  const double age = (stamp - last_accepted).seconds();
  if (age > kCoastLimit) return Health::kFailed;
  if (age > kGoodAge && health == Health::kGood) return Health::kDegraded;
  return health;
}

}  // namespace swiftlet
