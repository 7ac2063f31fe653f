#include "estimator/odometry/health_monitor.hpp"

namespace swiftlet {
namespace {

constexpr std::uint64_t kSettlingFrames = 10;
constexpr int kMinSightings = 8;       // a frame with fewer accepted sightings is not accepted
constexpr int kNominalSightings = 25;  // fewer: degraded
// Coasting position error grows with the cube of time: after 3 s it is metres.
constexpr double kCoastLimit = 3.0;  // s

}  // namespace

void HealthMonitor::reset() {
  health_ = Health::kInitializing;
  has_image_ = false;
}

Health HealthMonitor::update(const TrackedFrame& frame, const FrameStatistics& statistics,
                             std::size_t cameras, bool imu_missing, std::uint64_t frames_in_epoch) {
  const int sightings = statistics.inliers_mono + statistics.inliers_stereo;
  if (sightings >= kMinSightings || frames_in_epoch <= 1) {
    last_accepted_ = frame.stamp;
    has_image_ = true;
  }
  bool all_cameras = true;
  for (std::size_t c = 0; c < cameras; ++c) all_cameras = all_cameras && frame.camera_present[c];
  if (frames_in_epoch < kSettlingFrames) {
    health_ = Health::kInitializing;
  } else {
    health_ =
        sightings >= kNominalSightings && all_cameras && !imu_missing ? Health::kGood : Health::kDegraded;
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
