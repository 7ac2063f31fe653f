#include "estimator/messages/names.hpp"

namespace swiftlet {

std::string_view healthName(Health health) {
  switch (health) {
    case Health::kInitializing:
      return "initializing";
    case Health::kGood:
      return "good";
    case Health::kDegraded:
      return "degraded";
    case Health::kFailed:
      return "failed";
  }
  return "unknown";
}

std::optional<Health> healthNamed(std::string_view name) {
  for (const Health health : {Health::kInitializing, Health::kGood, Health::kDegraded, Health::kFailed}) {
    if (healthName(health) == name) return health;
  }
  return std::nullopt;
}

std::string_view eventName(EventKind kind) {
  switch (kind) {
    case EventKind::kImuGap:
      return "imu_gap";
    case EventKind::kImuSaturated:
      return "imu_saturated";
    case EventKind::kImuInvalid:
      return "imu_invalid";
    case EventKind::kFrameDropped:
      return "frame_dropped";
    case EventKind::kCameraLost:
      return "camera_lost";
    case EventKind::kCameraBack:
      return "camera_back";
    case EventKind::kBlackoutStarted:
      return "blackout_started";
    case EventKind::kBlackoutEnded:
      return "blackout_ended";
    case EventKind::kRestStarted:
      return "rest_started";
    case EventKind::kRestEnded:
      return "rest_ended";
    case EventKind::kInitialized:
      return "initialized";
    case EventKind::kHealthChanged:
      return "health_changed";
    case EventKind::kReset:
      return "reset";
    case EventKind::kCapacityReached:
      return "capacity_reached";
    case EventKind::kStampsWentBack:
      return "stamps_went_back";
    case EventKind::kDoubt:
      return "doubt";
  }
  return "unknown";
}

std::string_view doubtName(Doubt doubt) {
  switch (doubt) {
    case Doubt::kNone:
      return "none";
    case Doubt::kNoImage:
      return "no_image";
    case Doubt::kImplausible:
      return "implausible";
    case Doubt::kTracksDisagree:
      return "tracks_disagree";
    case Doubt::kImuDisagrees:
      return "imu_disagrees";
    case Doubt::kUncertain:
      return "uncertain";
    case Doubt::kScaleDisagrees:
      return "scale_disagrees";
    case Doubt::kScaleUnknown:
      return "scale_unknown";
    case Doubt::kSettling:
      return "settling";
    case Doubt::kCameraMissing:
      return "camera_missing";
    case Doubt::kFewSightings:
      return "few_sightings";
  }
  return "unknown";
}

}  // namespace swiftlet
