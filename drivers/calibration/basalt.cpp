// Basalt's calibration JSON: cameras, extrinsics and IMU in one file. JSON is read as YAML, so errors have
// line numbers.

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "drivers/calibration/sensor_fields.hpp"
#include "estimator/core/units.hpp"

namespace swiftlet {
namespace {

constexpr double kQuaternionTolerance = 1e-3;
constexpr double kFromNs = 1e-9;

double numberAt(const YamlField& map, const char* key) {
  return map.at(key, "Give the file as written by Basalt").number();
}

SE3 poseOf(const YamlField& pose, Warnings& warnings) {
  const Eigen::Quaterniond q(numberAt(pose, "qw"), numberAt(pose, "qx"), numberAt(pose, "qy"),
                             numberAt(pose, "qz"));
  if (!(std::abs(q.norm() - 1) < kQuaternionTolerance)) {
    throw pose.error("the quaternion does not have unit length",
                     "Give all digits of the calibration's result");
  }
  const Eigen::Vector3d p(numberAt(pose, "px"), numberAt(pose, "py"), numberAt(pose, "pz"));
  return checkedTransform(pose.place(), q.normalized().toRotationMatrix(), p, warnings);
}

LensFit basaltLens(const YamlField& camera, const std::array<int, 2>& size, Warnings& warnings) {
  const YamlField type = camera.at("camera_type");
  const YamlField values = camera.at("intrinsics");
  SourceLens lens;
  lens.name = type.text();
  lens.width = size[0];
  lens.height = size[1];
  lens.intrinsics = {numberAt(values, "fx"), numberAt(values, "fy"), numberAt(values, "cx"),
                     numberAt(values, "cy")};
  const auto take = [&](std::initializer_list<const char*> keys, double* out) {
    for (const char* key : keys) *out++ = numberAt(values, key);
  };
  if (lens.name == "kb4") {
    lens.family = LensFamily::kEquidistant;
    take({"k1", "k2", "k3", "k4"}, lens.distortion.data());
  } else if (lens.name == "ds") {
    lens.family = LensFamily::kDoubleSphere;
    take({"xi", "alpha"}, lens.shape.data());
  } else if (lens.name == "eucm") {
    lens.family = LensFamily::kExtendedUnified;
    take({"alpha", "beta"}, lens.shape.data());
  } else if (lens.name == "ucm") {
    lens.family = LensFamily::kExtendedUnified;
    lens.shape = {numberAt(values, "alpha"), 1};
  } else if (lens.name == "fov") {
    lens.family = LensFamily::kFieldOfView;
    lens.shape[0] = numberAt(values, "w");
  } else if (lens.name == "pinhole-radtan8") {
    take({"k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"}, lens.distortion.data());
    if (values.has("rpmax")) lens.max_radius = numberAt(values, "rpmax");
  } else if (lens.name != "pinhole") {
    throw type.error("camera type `" + lens.name + "` is not supported",
                     "swiftlet reads kb4, ds, eucm, ucm, fov, pinhole and pinhole-radtan8");
  }
  return acceptLens(values.place(), lens, warnings);
}

/// A single number, or the largest of three axes.
double densityOf(const YamlField& field) {
  const std::vector<double> values = field.isList() ? field.numbers() : std::vector<double>{field.number()};
  const double largest = values.empty() ? 0 : *std::max_element(values.begin(), values.end());
  if (!(largest > 0))
    throw field.error("not positive", "Give the noise in continuous time, one number or three");
  return largest;
}

void warnOfScale(const YamlField& root, const char* key, Warnings& warnings) {
  if (!root.has(key)) return;
  const YamlField field = root.at(key);
  const std::vector<double> values = field.numbers();
  constexpr std::size_t kBias = 3;  // the estimator finds the bias itself
  double largest = 0;
  for (std::size_t i = kBias; i < values.size(); ++i) largest = std::max(largest, std::abs(values[i]));
  if (largest == 0) return;
  warnings.push_back(field.where() + fmt::format(": scale and misalignment of up to {:.2g} % are not applied",
                                                 100 * largest));
}

}  // namespace

Calibration parseBasaltCalibration(const NamedText& text, const CalibrationOptions& options) {
  const YamlField file = YamlField::parse(text.name, text.text);
  const YamlField root = file.has("value0") ? file.at("value0") : file;
  Calibration calibration;
  calibration.form = "Basalt";
  const YamlField lenses = root.at("intrinsics");
  const std::vector<YamlField> cameras = lenses.items();
  const std::vector<YamlField> sizes = root.at("resolution", "Give [width, height] of each camera").items();
  const std::vector<YamlField> poses = root.at("T_imu_cam", "Calibrate the cameras with the IMU").items();
  if (sizes.size() != cameras.size() || poses.size() != cameras.size()) {
    throw lenses.error(
        fmt::format("{} lenses, {} resolutions and {} poses", cameras.size(), sizes.size(), poses.size()),
        "Give one of each for every camera");
  }
  if (cameras.size() > kMaxCameras) {
    calibration.warnings.push_back(text.name + ": more than two cameras; the first two are used");
  }
  std::vector<CameraEntry> entries;
  for (std::size_t i = 0; i < std::min(cameras.size(), kMaxCameras); ++i) {
    CameraEntry entry;
    entry.lens = basaltLens(cameras[i], readResolution(sizes[i]), calibration.warnings);
    entry.T_body_cam = poseOf(poses[i], calibration.warnings);
    if (root.has("cam_time_offset_ns")) {
      const YamlField shift = root.at("cam_time_offset_ns");
      entry.shift_s = checkedShift(shift.place(), kFromNs * shift.number(), calibration.warnings);
    }
    entry.file = text.name;
    entry.line = poses[i].line();
    entry.field = poses[i].name();
    entries.push_back(std::move(entry));
  }
  ImuNoise noise;
  noise.rate_hz = densityOf(root.at("imu_update_rate", "Give the IMU's rate [Hz]"));
  const char* const remedy = "Give the continuous-time noise of Basalt's calibration";
  noise.gyro_density = densityOf(root.at("gyro_noise_std", remedy));
  noise.gyro_walk = densityOf(root.at("gyro_bias_std", remedy));
  noise.accel_density = densityOf(root.at("accel_noise_std", remedy));
  noise.accel_walk = densityOf(root.at("accel_bias_std", remedy));
  calibration.noise = noise;
  warnOfScale(root, "calib_accel_bias", calibration.warnings);
  warnOfScale(root, "calib_gyro_bias", calibration.warnings);
  assembleRig(entries, options, calibration);
  return calibration;
}

}  // namespace swiftlet
