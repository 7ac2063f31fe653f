// A vehicle that hovers and drifts is not at rest, whatever its height and its cameras' rate: through the
// whole stage, with an IMU that feels nothing of the drift.

#include <catch2/catch.hpp>
#include <cmath>
#include <memory>

#include "drivers/simulated/rig_presets.hpp"
#include "estimator/core/random.hpp"
#include "estimator/odometry/odometry.hpp"
#include "tests/support/long_run.hpp"

using namespace swiftlet;

namespace {

constexpr double kHoverTrackNoise = 0.15;  // px
constexpr double kDrift = 0.05;            // m/s
constexpr int kGrid = 12;                  // points along each side of the ground in view

struct Hover {
  RigKind rig = RigKind::kEuroc;
  double height = 1;  ///< m above the ground, straight below
  double rate = 20;   ///< Hz
  bool stereo = true;
};

struct Outcome {
  int frames = 0;  ///< with a state
  int rests = 0;
};

Outcome hover(const Hover& flown, double seconds) {
  const Rig rig = makeRig(flown.rig).rig;
  const ImuNoise noise;
  OdometrySettings settings;
  settings.use_stereo = flown.stereo;
  Odometry odometry(rig, noise, settings);
  Random random(11);
  // Camera 0 looks straight down.
  const Eigen::Quaterniond R_world_cam(Eigen::Matrix3d(Eigen::Vector3d(1, -1, -1).asDiagonal()));
  const Eigen::Quaterniond R_world_body = R_world_cam * rig.T_body_cam[0].rotation.conjugate();
  const Eigen::Vector3d force = R_world_body.conjugate() * Eigen::Vector3d(0, 0, noise.gravity);
  const double spacing = 0.1 * flown.height;  // m between the points on the ground
  const auto output = std::make_unique<OdometryOutput>();
  Outcome outcome;
  std::int64_t sample = 0;
  for (int k = 0; k < seconds * flown.rate; ++k) {
    const double t = 1 + k / flown.rate;
    for (; static_cast<double>(sample) / noise.rate_hz <= t; ++sample) {
      ImuSample imu;
      imu.stamp = Stamp{} + Duration::fromSeconds(static_cast<double>(sample) / noise.rate_hz);
      const double scale = std::sqrt(noise.rate_hz);
      for (int axis = 0; axis < 3; ++axis) {
        imu.gyro[axis] = noise.gyro_density * scale * random.normal();
        imu.accel[axis] = force[axis] + noise.accel_density * scale * random.normal();
      }
      static_cast<void>(odometry.addImu(imu));
    }
    const SE3 T_world_body(R_world_body, {kDrift * t, 0, flown.height});
    auto frame = std::make_unique<TrackedFrame>();
    frame->stamp = Stamp{} + Duration::fromSeconds(t);
    frame->index = static_cast<std::uint64_t>(k);
    frame->camera_present = {true, flown.stereo};
    frame->keyframe = k % static_cast<int>(flown.rate / 4) == 0;
    for (int i = 0; i < kGrid * kGrid; ++i) {
      const Eigen::Vector3d point((i % kGrid - 0.5 * kGrid) * spacing, (i / kGrid - 0.5 * kGrid) * spacing,
                                  0);
      TrackedFeature feature;
      feature.id = static_cast<TrackId>(i);
      for (std::size_t c = 0; c < (flown.stereo ? 2U : 1U); ++c) {
        Eigen::Vector2d pixel;
        feature.seen[c] =
            rig.camera[c].project((T_world_body * rig.T_body_cam[c]).inverse() * point, pixel) &&
            rig.camera[c].inImage(pixel);
        for (int axis = 0; axis < 2; ++axis) pixel[axis] += kHoverTrackNoise * random.normal();
        feature.pixel[c] = pixel.cast<float>();
      }
      if (feature.seen[0] || feature.seen[1]) frame->features.pushBack(feature);
    }
    static_cast<void>(odometry.smooth(*frame, Effort{}, *output));
    if (!output->has_state) continue;
    ++outcome.frames;
    outcome.rests += output->statistics.at_rest ? 1 : 0;
  }
  return outcome;
}

}  // namespace

TEST_CASE("hover: drifting at 5 cm/s is never rest", "[hover][long]") {
  constexpr double kMiddleHeight = 7;
  for (const RigKind rig : {RigKind::kEuroc, RigKind::kFisheye}) {
    for (const double rate : {20.0, 120.0}) {
      for (const double height : {1.0, kMiddleHeight, 50.0}) {
        for (const bool stereo : {true, false}) {
          // Frames cost the same at any rate: the fast camera once, where the scale is unknown.
          if (rate > 100 && (stereo || rig != RigKind::kEuroc)) continue;
          const bool most_usual = rate < 100 && rig == RigKind::kEuroc;
          if (!longRun() && !most_usual && height != kMiddleHeight) continue;
          INFO(rigName(rig) << ", " << height << " m, " << rate << " Hz, stereo " << stereo);
          const Outcome outcome = hover({rig, height, rate, stereo}, 4);
          CHECK(outcome.rests == 0);
          if (stereo) CHECK(outcome.frames > 3 * rate);
        }
      }
    }
  }
}
