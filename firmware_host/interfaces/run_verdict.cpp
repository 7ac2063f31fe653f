#include "firmware_host/interfaces/run_verdict.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "estimator/messages/names.hpp"
#include "estimator/messages/state_sigmas.hpp"

namespace swiftlet {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::array kHealths{Health::kInitializing, Health::kGood, Health::kDegraded, Health::kFailed};
constexpr double kDegrees = 180.0 / M_PI;
// A doubt that lasts a smaller share of the run is not reported.
constexpr double kWorthTelling = 0.05;  // share of the run's time
constexpr double kNoisyTracks = 1.5;    // times the configured noise
constexpr double kNoisyImu = 1.5;       // times the configured noise
constexpr double kBentGyro = 0.01;      // of a reading: two sigmas of a typical new sensor

/// What to check first.
const char* remedy(Doubt doubt) {
  switch (doubt) {
    case Doubt::kNoImage:
      return "no images or dark images: check cables, exposure, light";
    case Doubt::kImplausible:
      return "above health.max_speed or health.max_acceleration: check calibration, axes, stamps";
    case Doubt::kTracksDisagree:
      return "tracks do not fit one motion: check calibration, rolling shutter, stamps; or the scene moves";
    case Doubt::kImuDisagrees:
      return "IMU and images disagree: check T_body_cam, the IMU's axes, stamps, noise densities";
    case Doubt::kUncertain:
      return "velocity or tilt is uncertain: few or distant features; check noise densities";
    case Doubt::kScaleDisagrees:
      return "the accelerometer contradicts the scale: check focal length, T_body_cam, stamps";
    case Doubt::kScaleUnknown:
      return "one camera: the scale is observable only while the body accelerates";
    case Doubt::kSettling:
      return "start or interruption: check for missing images, missing samples, resets";
    case Doubt::kCameraMissing:
      return "images of one camera are missing";
    case Doubt::kFewSightings:
      return "few features: check texture, light, motion blur, focus";
    case Doubt::kNone:
      break;
  }
  return "";
}

}  // namespace

void RunVerdict::add(Stamp stamp, const OdometryOutput& output) {
  const Health health = output.has_state ? output.state.health : Health::kInitializing;
  const Doubt doubt = output.has_state ? output.doubt : Doubt::kSettling;
  // Each frame counts for the time since the previous frame.
  const double seconds = last_ ? std::max(0.0, (stamp - *last_).seconds()) : 0;
  last_ = stamp;
  seconds_ += seconds;
  by_health_[static_cast<std::size_t>(health)] += seconds;
  if (health != Health::kGood) by_doubt_[doubt] += seconds;
  resets_ = std::max(resets_, output.state.epoch);
  if (!output.has_state) return;
  calibration_ = output.calibration;
  top_speed_ = std::max(top_speed_, output.state.v_world_body.norm());
  const double pixel_sigma = output.statistics.noise.pixel_sigma;
  if (state_seconds_ == 0) first_pixel_sigma_ = pixel_sigma;
  pixel_sigma_s_ += seconds * pixel_sigma;
  pose_variance_factor_s_ += seconds * output.statistics.pose_variance_factor;
  gyro_factor_s_ += seconds * output.statistics.noise.imu.gyro;
  accel_factor_s_ += seconds * output.statistics.noise.imu.accel;
  state_seconds_ += seconds;
  if (health != Health::kGood) return;
  largest_velocity_sigma_ = std::max(largest_velocity_sigma_, velocitySigma(output.state));
  largest_tilt_sigma_ = std::max(largest_tilt_sigma_, tiltSigma(output.state));
}

double RunVerdict::shareGood() const {
  return seconds_ > 0 ? by_health_[static_cast<std::size_t>(Health::kGood)] / seconds_ : 1;
}

const CalibrationEstimate* RunVerdict::estimatedCalibration() const {
  return calibration_ && (calibration_->shift_sigma > 0 || calibration_->rotation_sigma[0] > 0)
             ? &*calibration_
             : nullptr;
}

Json RunVerdict::json() const {
  Json json;
  json["in_words"] = words();
  json["seconds"] = seconds_;
  json["share_good"] = shareGood();
  for (const Health health : kHealths) {
    json["health_s"][std::string(healthName(health))] = by_health_[static_cast<std::size_t>(health)];
  }
  json["doubts_s"] = Json::object();
  for (const auto& [doubt, seconds] : by_doubt_) json["doubts_s"][std::string(doubtName(doubt))] = seconds;
  json["resets"] = resets_;
  json["top_speed_m_s"] = top_speed_;
  json["largest_velocity_sigma_good_m_s"] = largest_velocity_sigma_;
  json["largest_tilt_sigma_good_deg"] = kDegrees * largest_tilt_sigma_;
  json["mean_pixel_sigma_px"] = mean(pixel_sigma_s_);
  json["mean_pose_variance_factor"] = mean(pose_variance_factor_s_);
  json["mean_gyro_factor"] = mean(gyro_factor_s_);
  json["mean_accel_factor"] = mean(accel_factor_s_);
  if (calibration_ && !calibration_->gyro.matrix.isZero()) {
    Json rows = Json::array();
    const Eigen::Matrix3d& M = calibration_->gyro.matrix;
    for (int r = 0; r < 3; ++r) rows.push_back({M(r, 0), M(r, 1), M(r, 2)});
    json["gyro_matrix"] = rows;
  }
  if (estimatedCalibration() == nullptr) return json;
  const CalibrationEstimate& c = *calibration_;
  Json estimate = Json::object();
  if (c.shift_sigma > 0) {
    estimate["t_imu_minus_t_image_s"] = c.camera_to_imu_shift.seconds();
    estimate["sigma_s"] = c.shift_sigma;
  }
  if (c.readout_sigma > 0) {
    estimate["readout_s"] = c.readout.seconds();
    estimate["readout_sigma_s"] = c.readout_sigma;
  }
  for (std::size_t i = 0; i < kMaxCameras; ++i) {
    if (c.rotation_sigma[i] <= 0) continue;
    const Eigen::Matrix3d R = c.T_body_cam[i].R();
    const Eigen::Vector3d& p = c.T_body_cam[i].translation;
    Json rows = Json::array();
    for (int r = 0; r < 3; ++r) rows.push_back({R(r, 0), R(r, 1), R(r, 2), p[r]});
    rows.push_back({0, 0, 0, 1});
    estimate[fmt::format("cam{}", i)] = {{"T_body_cam", rows},
                                         {"rotation_sigma_deg", kDegrees * c.rotation_sigma[i]},
                                         {"position_sigma_m", c.position_sigma[i]}};
  }
  json["estimated_calibration"] = estimate;
  return json;
}

std::vector<std::string> RunVerdict::words() const {
  if (seconds_ <= 0) return {};
  std::string first = "health:";
  for (const Health health : kHealths) {
    const double share = by_health_[static_cast<std::size_t>(health)] / seconds_;
    if (share > 0 || health == Health::kGood)
      first += fmt::format(" {} {:.1f} %,", healthName(health), 100 * share);
  }
  first += fmt::format(" {} resets; top speed {:.2f} m/s", resets_, top_speed_);
  if (shareGood() > 0) {
    first += fmt::format("; while good, largest sigmas: velocity {:.3f} m/s, tilt {:.2f} deg",
                         largest_velocity_sigma_, kDegrees * largest_tilt_sigma_);
  }
  std::vector<std::string> words{first};
  if (mean(pixel_sigma_s_) > kNoisyTracks * first_pixel_sigma_) {
    words.push_back(
        fmt::format("  track residuals average {:.1f} px, smoother.pixel_sigma is {:.2f}: check calibration, "
                    "rolling shutter, stamps, motion blur",
                    mean(pixel_sigma_s_), first_pixel_sigma_));
  }
  for (const auto& [sensor, sum] : {std::pair("gyro", gyro_factor_s_), std::pair("accel", accel_factor_s_)}) {
    if (mean(sum) < kNoisyImu) continue;
    words.push_back(
        fmt::format("  errors of the {} are {:.1f} times its noise density with imu.{}_inflation: vibration, "
                    "or the density is too small",
                    sensor, mean(sum), sensor));
  }
  const double bent = calibration_ ? calibration_->gyro.matrix.cwiseAbs().maxCoeff() : 0;
  if (bent > kBentGyro) {
    words.push_back(
        fmt::format("  the gyro's scale or axes are off by up to {:.1f} % (estimated): check its calibration "
                    "and that of the cameras",
                    100 * bent));
  }
  for (const auto& [doubt, seconds] : by_doubt_) {
    if (seconds < kWorthTelling * seconds_) continue;
    words.push_back(fmt::format("  {:.1f} s {}: {}", seconds, doubtName(doubt), remedy(doubt)));
  }
  return words;
}

}  // namespace swiftlet
