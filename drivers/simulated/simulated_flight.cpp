#include "drivers/simulated/simulated_flight.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include "drivers/simulated/calibration_rig.hpp"
#include "drivers/simulated/given_motion.hpp"
#include "estimator/geometry/so3.hpp"

namespace swiftlet {
namespace {

constexpr double kLowLight = 0.05;           // share of normal light
constexpr double kLowLightExposure = 0.010;  // s
constexpr double kClearanceStep = 0.1;       // s between the path's points that furniture keeps clear of
constexpr double kSharpTime = 1e-9;          // s: image times are multiples of a period up to rounding

Rig turnedRig(const Rig& rig, const SimulationSettings& settings) {
  constexpr double kRadians = std::numbers::pi / 180;
  Rig turned = rig;
  const Eigen::Quaterniond whole = expSo3(kRadians * settings.rig_turn_deg);
  const Eigen::Vector3d centre = rig.T_body_cam[0].translation;
  for (std::size_t c = 0; c < rig.camera_count; ++c) {
    // Cameras that are not rotated stay unchanged to the last bit.
    if (settings.rig_turn_deg.isZero(0) && settings.camera_turn_deg[c].isZero(0)) continue;
    const Eigen::Quaterniond own = expSo3(kRadians * settings.camera_turn_deg[c]);
    const SE3& T = rig.T_body_cam[c];
    turned.T_body_cam[c] = SE3(own * whole * T.rotation, centre + whole * (T.translation - centre));
  }
  return turned;
}

MountedRig rigOf(SimulationSettings& settings) {
  if (!isRandom(settings.rig)) return makeRig(settings.rig);
  const CalibrationRig drawn = makeCalibrationRig(settings.rig, settings.rig_seed);
  settings.imu.noise = drawn.noise;
  settings.imu.gyro_matrix = drawn.gyro_matrix;
  settings.imu.accel_matrix = drawn.accel_matrix;
  settings.image_stamp_offset = -drawn.rig.camera_to_imu_shift;
  settings.render.readout = drawn.rig.readout.seconds();
  return mountForward(drawn.rig);
}

double longestExposure(const SimulationSettings& settings) {
  const double given = settings.render.exposure;
  return settings.exposure_mode == ExposureMode::kOdometry ? std::max(given, SimulatedExposure::kLongest)
                                                           : given;
}

}  // namespace

SimulatedFlight::SimulatedFlight(const SimulationSettings& settings) : settings_(settings) {
  SimulationSettings& s = settings_;
  const MountedRig mounted = rigOf(s);
  s.world.seed = s.world_seed != 0 ? s.world_seed : s.seed;
  s.flight.seed = s.imu.seed = s.sensor.seed = s.tracks.seed = s.seed;
  s.paint.threads = s.render.threads = s.threads;
  s.flight.gravity = s.imu.noise.gravity;
  if (s.low_light) {
    s.sensor.light *= kLowLight;
    s.render.exposure = kLowLightExposure;
  }
  for (const Fault& fault : s.faults) {
    if (fault.kind == FaultKind::kImuGap) s.imu.gaps.push_back(fault.span);
    if (fault.kind == FaultKind::kImuSaturation) s.imu.saturations.push_back(fault.span);
  }
  s.tracks.mono = s.mono;
  checkSettings();

  s.flight.R_flu_body = mounted.R_flu_body;
  true_rig_ = mounted.rig;
  if (s.mono) true_rig_.camera_count = 1;
  true_rig_.camera_to_imu_shift = -s.image_stamp_offset;
  true_rig_.readout = Duration::fromSeconds(s.render.readout);
  given_rig_ = turnedRig(true_rig_, s);
  given_rig_.camera_to_imu_shift = Duration{};

  flyAndBuild();
  imu_ = simulateImu(trajectory_, s.imu, s.start, duration_);
  // The trajectory must cover half an exposure after the last row.
  const double last = duration_ - 0.5 * (longestExposure(s) + s.render.readout);
  image_count_ =
      std::max(0, static_cast<int>(std::floor((last - s.first_image) * s.camera_rate + kSharpTime)) + 1);
  if (image_count_ == 0) throw std::invalid_argument("flight.duration: too short for an image");
}

void SimulatedFlight::checkSettings() const {
  const auto require = [](bool good, const char* what) {
    if (!good) throw std::invalid_argument(what);
  };
  require(settings_.flight.duration >= 0, "flight.duration: must not be negative");
  require(settings_.flight.duration > 0 || !settings_.given_motion.empty(),
          "flight.duration: must be positive");
  require(settings_.flight.speed > 0 && settings_.flight.speed < 20, "flight.speed: must lie in (0, 20) m/s");
  require(settings_.camera_rate > 0 && settings_.camera_rate <= 500, "camera_rate: must lie in (0, 500] Hz");
  require(settings_.imu.noise.rate_hz > 0 && settings_.imu.noise.rate_hz <= 10000,
          "imu.noise.rate_hz: must lie in (0, 10000] Hz");
  require(settings_.render.exposure > 0 && settings_.render.exposure < 1 / settings_.camera_rate,
          "render.exposure: must be positive and shorter than a frame");
  require(settings_.render.readout >= 0 && settings_.render.readout < 1 / settings_.camera_rate,
          "render.readout: must be shorter than a frame");
  require(settings_.jpeg_quality >= 1 && settings_.jpeg_quality <= 100, "jpeg_quality: must lie in [1, 100]");
  require(settings_.first_image >= 0.5 * (longestExposure(settings_) + settings_.render.readout),
          "first_image: must leave half an exposure and half a readout");
  double before = 0;
  for (const LightChange& change : settings_.light_changes) {
    require(change.begin >= before, "light_changes: each must begin after the previous one has ended");
    require(change.level > 0, "light_changes: the level must be positive");
    before = change.begin + kLightRamp;
  }
  require(settings_.paint.texel > 0 && settings_.paint.max_texels > 0, "paint.texel: must be positive");
  require(settings_.threads >= 1, "threads: at least 1");
}

void SimulatedFlight::flyAndBuild() {
  SimulationSettings& s = settings_;
  if (s.given_motion.empty()) {
    duration_ = s.flight.duration;
    trajectory_ = flyTour(worldTour(s.world), s.flight);
  } else {
    trajectory_ = readGivenMotion(s.given_motion, s.motion_skip, s.flight.duration);
    duration_ = trajectory_.endTime();
  }
  std::vector<Eigen::Vector3d> path;
  const auto add = [&path](const auto& trajectory, double seconds) {
    for (double t = 0; t <= seconds; t += kClearanceStep) path.push_back(trajectory.pose(t).translation);
  };
  for (const std::string& motion : s.world_for) {
    const SplineTrajectory other = readGivenMotion(motion);
    add(other, other.endTime());
  }
  if (path.empty()) add(trajectory_, duration_);
  const bool fits_motions = !s.given_motion.empty() || !s.world_for.empty();
  if (fits_motions && !fitWorld(s.world, path)) {
    throw std::invalid_argument(
        "world.kind: a given motion needs a world that can be resized (room, hall, cluttered)");
  }
  world_ = buildWorld(s.world, path);
}

double SimulatedFlight::imageTime(int k) const { return settings_.first_image + k / settings_.camera_rate; }

Stamp SimulatedFlight::imageStamp(int k) const {
  return stampAt(imageTime(k)) + settings_.image_stamp_offset;
}

bool SimulatedFlight::hasFault(FaultKind kind, std::size_t camera, double seconds) const {
  return std::any_of(settings_.faults.begin(), settings_.faults.end(), [&](const Fault& fault) {
    return fault.kind == kind && fault.span.contains(seconds) &&
           (fault.camera < 0 || static_cast<std::size_t>(fault.camera) == camera);
  });
}

FlightCameras::FlightCameras(const SimulatedFlight& flight)
    : flight_(&flight),
      world_(std::make_unique<TexturedWorld>(flight.world(), flight.settings().paint)),
      exposure_(flight.settings().exposure_mode, flight.settings().sensor, flight.settings().render.exposure,
                flight.settings().camera_rate, flight.trueRig().camera[0].focal()) {
  for (std::size_t c = 0; c < flight.trueRig().camera_count; ++c) {
    renderers_.emplace_back(*world_, flight.trueRig().camera[c], flight.trueRig().T_body_cam[c]);
  }
}

void FlightCameras::render(int k, const std::array<std::uint8_t*, kMaxCameras>& grey,
                           std::array<bool, kMaxCameras>& present) {
  const SimulationSettings& settings = flight_->settings();
  const double seconds = flight_->imageTime(k);
  present = {};
  const double light = lightAt(settings.light_changes, seconds);
  if (exposure_.started()) taken_with_ = exposure_.now();
  double mean = 0;  // of camera 0
  for (std::size_t c = 0; c < renderers_.size(); ++c) {
    const bool missing = flight_->hasFault(FaultKind::kCameraMissing, c, seconds);
    // The first exposure needs camera 0's brightness even if its first images are missing.
    if (missing && (c != 0 || exposure_.started())) continue;
    const CameraModel& camera = renderers_[c].camera();
    const bool dark = flight_->hasFault(FaultKind::kBlackout, c, seconds);
    const ExposureSetting& setting = taken_with_;
    RenderSettings render = settings.render;
    if (exposure_.started()) render.exposure = setting.exposure.seconds();
    renderers_[c].renderImage(flight_->trajectory(), seconds, render, radiance_);
    if (!exposure_.started()) {
      exposure_.start(meanRadiance(radiance_, camera.width(), camera.height()));
      taken_with_ = exposure_.now();
    }
    if (missing) continue;
    if (dark) std::fill(radiance_.begin(), radiance_.end(), 0.0F);
    SensorSettings sensor = settings.sensor;
    sensor.light *= light * setting.exposure.seconds() / settings.render.exposure;
    const double image_mean =
        exposeImage(radiance_, camera.width(), camera.height(), sensor, setting.gain,
                    static_cast<std::uint64_t>(k), static_cast<std::uint32_t>(c), settings.threads, grey[c]);
    present[c] = true;
    if (c == 0 && !dark) mean = image_mean;
  }
  const CameraModel& camera = renderers_[0].camera();
  ImageView seen;
  if (present[0]) seen = {grey[0], camera.width(), camera.height(), camera.width()};
  exposure_.update(static_cast<std::uint64_t>(k), seen, mean,
                   flight_->trajectory().at(seconds).omega_body.norm());
}

}  // namespace swiftlet
