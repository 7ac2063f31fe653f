#include "tests/smoother/track_flight.hpp"

#include <algorithm>
#include <cmath>

namespace swiftlet::test {
namespace {

// What a fault leaves of a frame. False when nothing comes at all.
bool applyFaults(const SimulatedFlight& flight, double seconds, TrackedFrame& frame) {
  std::array<bool, kMaxCameras> blind{};
  bool any = false;
  for (std::size_t c = 0; c < flight.trueRig().camera_count; ++c) {
    const bool missing = flight.hasFault(FaultKind::kCameraMissing, c, seconds);
    frame.camera_present[c] = !missing;
    blind[c] = missing || flight.hasFault(FaultKind::kBlackout, c, seconds);
    any = any || !missing;
  }
  FixedVector<TrackedFeature, kMaxFeatures> kept;
  for (TrackedFeature feature : frame.features) {
    for (std::size_t c = 0; c < kMaxCameras; ++c) feature.seen[c] = feature.seen[c] && !blind[c];
    if (feature.seen[0] || feature.seen[1]) static_cast<void>(kept.tryPushBack(feature));
  }
  frame.features = kept;
  return any;
}

}  // namespace

TrackFlight::TrackFlight(const SimulationSettings& settings) : flight_(settings) {
  TrackSimulator tracks(flight_.world(), flight_.trueRig(), flight_.trajectory(), flight_.settings().tracks);
  TrackedFrame frame;
  std::vector<TrackTruth> truth;
  for (int k = 0; k < flight_.imageCount(); ++k) {
    const double seconds = flight_.imageTime(k);
    tracks.step(seconds, flight_.imageStamp(k), frame, &truth);
    for (std::size_t f = 0; f < truth.size(); ++f) landmarks_[frame.features[f].id] = truth[f].landmark;
    if (!applyFaults(flight_, seconds, frame)) continue;
    frames_.push_back(frame);
    seconds_.push_back(seconds);
  }
}

BodyState TrackFlight::truth(std::size_t k) const {
  const MotionState motion = flight_.trajectory().at(seconds_[k]);
  const SimulatedImu& imu = flight_.imu();
  const auto step = static_cast<std::size_t>(std::lround(seconds_[k] * noise().rate_hz));
  const std::size_t index = std::min(step, imu.bias_gyro.size() - 1);
  return {motion.T_world_body, motion.v_world_body, imu.bias_gyro[index], imu.bias_accel[index]};
}

SimulationSettings roomFlight(double duration, std::uint64_t seed) {
  SimulationSettings settings;
  settings.seed = seed;
  settings.flight.duration = duration;
  return settings;
}

}  // namespace swiftlet::test
