#include "tests/odometry/faulty_flight.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "estimator/core/random.hpp"
#include "estimator/geometry/so3.hpp"
#include "tests/odometry/odometry_run.hpp"

namespace swiftlet::test {
namespace {

constexpr std::uint64_t kStream = 77;
constexpr double kReadout = 0.030;        // s, first to last row
constexpr double kJitterSigma = 0.020;    // s
constexpr double kMovingPeriod = 4;       // s, to and fro
constexpr double kBlurredLifetime = 0.4;  // s

double signedUniform(Random& random, double low, double high) {
  const double size = random.uniform(low, high);
  return random.uniform() < 0.5 ? -size : size;
}

SimulationSettings settingsWith(SimulationSettings settings, RigFault fault, Random& random) {
  if (fault == RigFault::kLate) settings.first_image += 0.2;  // no sample is missing when stamps are early
  if (fault == RigFault::kRolling) settings.render.readout = kReadout;
  if (fault == RigFault::kBlur) {
    settings.tracks.pixel_sigma = random.uniform(3, 6);
    settings.tracks.mean_lifetime = kBlurredLifetime;
    settings.tracks.dropout = 0.3;
  }
  return settings;
}

CameraModel withFocal(const CameraModel& camera, double factor) {
  Eigen::Vector4d intrinsics = camera.intrinsics();
  intrinsics.head<2>() *= factor;
  return {camera.kind(), camera.width(), camera.height(), intrinsics, camera.distortion()};
}

void spoilCalibration(RigFault fault, Random& random, GivenFlight& out) {
  if (fault == RigFault::kFocal) {
    const double factor = 1 + signedUniform(random, 0.05, 0.15);
    for (CameraModel& camera : out.rig.camera) {
      if (camera.width() > 0) camera = withFocal(camera, factor);
    }
  } else if (fault == RigFault::kTurned) {
    const double angle = random.uniform(3, 20) * std::numbers::pi / 180;
    const Eigen::Quaterniond turn = expSo3(angle * randomDirection(random));
    for (SE3& T : out.rig.T_body_cam) T.rotation = turn * T.rotation;
  } else if (fault == RigFault::kRolling) {
    out.rig.readout = Duration{};
  } else if (fault == RigFault::kLoud || fault == RigFault::kQuiet) {
    const double factor = fault == RigFault::kLoud ? 10 : 0.1;
    for (double* const density :
         {&out.noise.gyro_density, &out.noise.accel_density, &out.noise.gyro_walk, &out.noise.accel_walk}) {
      *density *= factor;
    }
  }
}

void exchangeAxes(Random& random, std::vector<ImuSample>& samples) {
  // One of the proper rotations that exchange axes, other than none.
  const int kind = static_cast<int>(random.below(4));
  Eigen::Matrix3d R = Eigen::Matrix3d::Zero();
  if (kind == 0) R << 0, 1, 0, 1, 0, 0, 0, 0, -1;
  if (kind == 1) R << 0, 0, 1, 1, 0, 0, 0, 1, 0;
  if (kind == 2) R << 0, 1, 0, 0, 0, 1, 1, 0, 0;
  if (kind == 3) R << -1, 0, 0, 0, -1, 0, 0, 0, 1;
  for (ImuSample& sample : samples) {
    sample.gyro = R * sample.gyro;
    sample.accel = R * sample.accel;
  }
}

void jitter(Random& random, std::vector<Stamp>& stamps) {
  for (std::size_t k = 0; k < stamps.size(); ++k) {
    stamps[k] = stamps[k] + Duration::fromSeconds(kJitterSigma * random.normal());
    if (k == 0) continue;
    stamps[k] = std::max(stamps[k], stamps[k - 1] + Duration::fromMilliseconds(1));
  }
}

void moveScene(Random& random, FaultyFlight& out) {
  const Eigen::Vector3d swing = random.uniform(0.2, 0.8) * randomDirection(random);  // m
  const double share = random.uniform(0.3, 0.5);
  const Rig& rig = out.flight.flight().trueRig();
  for (std::size_t k = 0; k < out.frames.size(); ++k) {
    const SE3 T_world_body = out.flight.truth(k).T_world_body;
    const double phase = std::sin(2 * std::numbers::pi / kMovingPeriod * out.flight.seconds(k));
    for (TrackedFeature& feature : out.frames[k].features) {
      // Which ones follows from the id alone.
      if (Random(feature.id, kStream).uniform() > share) continue;
      for (std::size_t c = 0; c < rig.camera_count; ++c) {
        const SE3 T_cam_world = (T_world_body * rig.T_body_cam[c]).inverse();
        const Eigen::Vector3d& still = out.flight.landmark(feature.id);
        Eigen::Vector2d there;
        Eigen::Vector2d moved;
        if (!feature.seen[c] || !rig.camera[c].project(T_cam_world * still, there) ||
            !rig.camera[c].project(T_cam_world * (still + phase * swing), moved) ||
            !rig.camera[c].inImage(moved)) {
          continue;
        }
        feature.pixel[c] += (moved - there).cast<float>();
      }
    }
  }
}

}  // namespace

void spoil(RigFault fault, std::uint64_t seed, GivenFlight& given) {
  Random random(seed, kStream + 1);
  spoilCalibration(fault, random, given);
  if (fault == RigFault::kExchanged) exchangeAxes(random, given.samples);
  if (fault == RigFault::kLate) {
    const Duration offset = Duration::fromSeconds(signedUniform(random, 0.020, 0.150));
    for (Stamp& stamp : given.stamps) stamp = stamp + offset;
  }
  if (fault == RigFault::kJitter) jitter(random, given.stamps);
}

FaultyFlight::FaultyFlight(const SimulationSettings& settings, RigFault fault, std::uint64_t seed)
    : flight([&] {
        Random random(seed, kStream);
        return settingsWith(settings, fault, random);
      }()),
      given{flight.rig(), flight.noise(), flight.flight().imu().samples, {}},
      frames(flight.frames()) {
  if (fault == RigFault::kMoving) {
    Random random(seed, kStream + 1);
    moveScene(random, *this);
  }
  for (const TrackedFrame& frame : frames) given.stamps.push_back(frame.stamp);
  spoil(fault, seed, given);
  for (std::size_t k = 0; k < frames.size(); ++k) frames[k].stamp = given.stamps[k];
}

}  // namespace swiftlet::test
