#include "drivers/calibration/sensor_fields.hpp"

#include <fmt/format.h>

#include <Eigen/SVD>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "estimator/core/units.hpp"

namespace swiftlet {
namespace {

// Errors of rotations: about 1e-7 in single precision, 1e-4 when rounded to 4 digits.
constexpr double kOrthonormalWarn = 1e-6;
constexpr double kOrthonormalRefuse = 1e-3;
// A skew changes the right angle between image axes by skew / fx; calibration tools give exactly zero [px].
constexpr double kMaxSkew = 1e-6;
constexpr double kLastRowTolerance = 1e-9;
constexpr double kMaxLever = 10;   // m; a rig is smaller, so more means millimetres
constexpr double kUsualLever = 1;  // m; OAK files in centimetres give about 7
constexpr const char* kMetres =
    "Translations are in metres: is this in millimetres, centimetres (OAK) or board squares (OpenCV)?";
constexpr double kShiftWarn_s = 0.1;
constexpr double kShiftRefuse_s = 1.0;
constexpr double kReadoutRefuse_s = 0.2;  // the slowest phone takes 61 ms
// Image side over focal length: 4 for fisheyes of 220 degrees, 0.05 for a telescope.
constexpr double kWidestView = 12;
constexpr double kNarrowestView = 0.02;
constexpr int kMinImageSide = 16;
constexpr int kMaxImageSide = 16384;

// Bounds outside of which a density is almost certainly in another unit or per sample.
constexpr double kGyroDensityLow = 1e-5;
constexpr double kGyroDensityHigh = 1e-1;
constexpr double kAccelDensityLow = 1e-4;
constexpr double kAccelDensityHigh = 1;
constexpr double kGyroWalkHigh = 1e-2;
constexpr double kAccelWalkHigh = 1e-1;

void checkLastRow(const YamlField& field, const Eigen::Matrix4d& T) {
  const Eigen::RowVector4d expected(0, 0, 0, 1);
  if ((T.row(3) - expected).cwiseAbs().maxCoeff() <= kLastRowTolerance) return;
  if ((T.col(3) - expected.transpose()).cwiseAbs().maxCoeff() <= kLastRowTolerance) {
    throw field.error("the last column is 0 0 0 1: the matrix is stored by columns",
                      "Transpose it: rows first, translation in the last column");
  }
  throw field.error("the last row is not 0 0 0 1", "Write a rigid transform [R t; 0 0 0 1], row by row");
}

void checkCorners(const InputPlace& place, const CameraModel& model, Warnings& warnings) {
  int lost = 0;
  for (const double x : {0.0, model.width() - 1.0}) {
    for (const double y : {0.0, model.height() - 1.0}) {
      Eigen::Vector3d bearing;
      if (!model.unproject({x, y}, bearing)) ++lost;
    }
  }
  // Only for pinholes: the corners of a fisheye image are dark.
  if (lost > 0 && model.kind() == CameraKind::kPinholeRadtan) {
    warnings.push_back(place.where() +
                       fmt::format(": the lens model has no inverse in {} of the 4 image corners (it folds "
                                   "back); points there are ignored",
                                   lost));
  }
}

double readPositive(const YamlField& imu, const std::string& key) {
  const YamlField field = imu.at(key, "Take it from the data sheet or an Allan plot; continuous-time units");
  const double value = field.number();
  if (value <= 0) {
    throw field.error(
        fmt::format("{} is not positive", value),
        "A noise density of zero makes the filter trust the IMU without limit; give the actual one");
  }
  return value;
}

void warnOutside(const YamlField& field, double value, double low, double high, const char* unit,
                 Warnings& warnings) {
  if (value >= low && value <= high) return;
  warnings.push_back(
      field.where() +
      fmt::format(": {} {} is outside {}..{}: is it in another unit, or per sample instead of per sqrt(Hz)?",
                  value, unit, low, high));
}

}  // namespace

std::vector<double> readNumbers(const YamlField& field) {
  if (field.isMap()) return field.at("data", "Write the numbers row by row under `data`").numbers();
  std::vector<double> values;
  for (const YamlField& row : field.items()) {
    if (!row.isList()) {
      values.push_back(row.number());
      continue;
    }
    const std::vector<double> part = row.numbers();
    values.insert(values.end(), part.begin(), part.end());
  }
  return values;
}

std::vector<double> readMatrix(const YamlField& field, std::size_t rows, std::size_t columns) {
  std::vector<double> values = readNumbers(field);
  if (values.size() != rows * columns) {
    throw field.error(
        fmt::format("{} numbers, but a {}x{} matrix has {}", values.size(), rows, columns, rows * columns),
        fmt::format("Write {} rows of {} numbers", rows, columns));
  }
  return values;
}

Eigen::Vector4d readIntrinsics(const InputPlace& place, const Eigen::Matrix3d& K) {
  if (!K.allFinite() || K.isZero(0)) {
    throw place.error("the camera is not calibrated", "Calibrate it; drivers send zeros until then");
  }
  if (std::abs(K(0, 1)) > kMaxSkew) {
    throw place.error(fmt::format("a skew of {:g} px", K(0, 1)), "Calibrate with zero skew");
  }
  if (K(1, 0) != 0 || K(2, 0) != 0 || K(2, 1) != 0 || K(2, 2) != 1) {
    throw place.error("not a camera matrix", "Write fx 0 cx, 0 fy cy, 0 0 1, row by row");
  }
  return {K(0, 0), K(1, 1), K(0, 2), K(1, 2)};
}

SE3 readTransform(const YamlField& field, Warnings& warnings) {
  const std::vector<double> values = readMatrix(field, 4, 4);
  const Eigen::Matrix4d T = Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(values.data());
  checkLastRow(field, T);
  return checkedTransform(field.place(), T.topLeftCorner<3, 3>(), T.topRightCorner<3, 1>(), warnings);
}

SE3 checkedTransform(const InputPlace& place, const Eigen::Matrix3d& R, const Eigen::Vector3d& t,
                     Warnings& warnings) {
  const double defect = (R.transpose() * R - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  if (!(defect <= kOrthonormalRefuse)) {
    throw place.error(fmt::format("the rotation is not orthonormal (deviation {:.2g})", defect),
                      "Give all digits of the calibration's result");
  }
  if (R.determinant() < 0) {
    throw place.error("the rotation is a reflection (determinant -1)",
                      "Correct the axis with the wrong sign");
  }
  if (t.cwiseAbs().maxCoeff() > kMaxLever) {
    throw place.error(fmt::format("the translation is {:.3g} m long", t.norm()), kMetres);
  }
  if (t.norm() > kUsualLever) {
    warnings.push_back(place.where() +
                       fmt::format(": the translation is {:.3g} m long. {}", t.norm(), kMetres));
  }
  if (defect > kOrthonormalWarn) {
    warnings.push_back(
        place.where() +
        fmt::format(": the rotation deviates from orthonormal by {:.2g}; it was made orthonormal", defect));
  }
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(R, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Matrix3d nearest = svd.matrixU() * svd.matrixV().transpose();
  return {nearest, t};
}

void checkResolution(const InputPlace& place, double width, double height) {
  for (const double side : {width, height}) {
    if (side >= kMinImageSide && side <= kMaxImageSide && side == std::floor(side)) continue;
    throw place.error(fmt::format("{:g} x {:g} is not an image size in whole pixels", width, height),
                      fmt::format("Give width and height, {} to {}", kMinImageSide, kMaxImageSide));
  }
}

void checkIntrinsics(const InputPlace& place, const Eigen::Vector4d& k, int width, int height,
                     Warnings& warnings) {
  if (!(k[0] > 0 && k[1] > 0))
    throw place.error("a focal length is not positive", "Use the order fu, fv, cu, cv");
  const double view = std::max(width, height) / std::min(k[0], k[1]);
  if (!(view < kWidestView && view > kNarrowestView)) {
    throw place.error(
        fmt::format("a focal length of {:g} for an image of {}x{}", std::min(k[0], k[1]), width, height),
        "Focal lengths are in pixels: is this in millimetres, or a fraction of the width?");
  }
  if (k[2] > width && k[2] <= height) {
    throw place.error(fmt::format("cu {} lies outside a width of {}", k[2], width),
                      "`resolution` is swapped: write [width, height]");
  }
  if (k[2] < 0 || k[2] > width || k[3] < 0 || k[3] > height) {
    throw place.error(
        fmt::format("the principal point ({}, {}) lies outside the {}x{} image", k[2], k[3], width, height),
        "Give intrinsics and resolution of the same image size; order: fu, fv, cu, cv");
  }
  if (std::abs(k[2] - 0.5 * width) > 0.25 * width || std::abs(k[3] - 0.5 * height) > 0.25 * height) {
    warnings.push_back(place.where() +
                       fmt::format(": the principal point ({}, {}) is far from the centre of the {}x{} "
                                   "image. Check that the intrinsics are for this resolution",
                                   k[2], k[3], width, height));
  }
}

std::array<int, 2> readResolution(const YamlField& field) {
  const std::vector<double> values = field.numbers();
  if (values.size() != 2) throw field.error("not of the form [width, height]", "Write it as [752, 480]");
  checkResolution(field.place(), values[0], values[1]);
  return {static_cast<int>(values[0]), static_cast<int>(values[1])};
}

void setBrown(const InputPlace& place, const std::vector<double>& values, SourceLens& lens) {
  constexpr std::array<std::size_t, 6> kCounts = {0, 4, 5, 8, 12, 14};
  if (std::find(kCounts.begin(), kCounts.end(), values.size()) == kCounts.end()) {
    throw place.error(
        fmt::format("{} numbers, expected 4, 5, 8, 12 or 14", values.size()),
        "Give k1, k2, p1, p2 and the model's further coefficients k3, k4..k6, s1..s4, tau_x, tau_y");
  }
  lens.family = LensFamily::kBrown;
  std::copy(values.begin(), values.end(), lens.distortion.begin());
}

void setEquidistant(const InputPlace& place, const std::vector<double>& values, SourceLens& lens) {
  if (values.size() != 4) {
    throw place.error(fmt::format("{} numbers, expected 4", values.size()), "Give k1..k4");
  }
  lens.family = LensFamily::kEquidistant;
  std::copy(values.begin(), values.end(), lens.distortion.begin());
}

LensFit acceptLens(const InputPlace& place, const SourceLens& lens, Warnings& warnings) {
  checkIntrinsics(place, lens.intrinsics, lens.width, lens.height, warnings);
  LensFit fit = convertLens(lens, place, warnings);
  if (fit.exact) checkCorners(place, fit.model, warnings);
  return fit;
}

LensFit readLens(const YamlField& camera, const std::string& coefficients_key, Warnings& warnings) {
  constexpr const char* kRemedy =
      "Calibrate as pinhole-radtan, pinhole-equi (wide lenses), omni-radtan, ds-none or eucm-none";
  SourceLens lens;
  const YamlField model_field =
      camera.at("camera_model", "swiftlet reads `pinhole`, `omni`, `ds` and `eucm`");
  const std::string model = model_field.text();
  std::size_t shape = 0;  // parameters before fu
  if (model == "omni") {
    lens.family = LensFamily::kOmni;
    shape = 1;
  } else if (model == "ds" || model == "eucm") {
    lens.family = model == "ds" ? LensFamily::kDoubleSphere : LensFamily::kExtendedUnified;
    shape = 2;
  } else if (model != "pinhole") {
    throw model_field.error("camera model `" + model + "` is not supported", kRemedy);
  }
  const auto [width, height] = readResolution(camera.at("resolution", "Write it as [width, height]"));
  lens.width = width;
  lens.height = height;
  constexpr std::array<const char*, 3> kOrder = {"fu, fv, cu, cv", "xi, fu, fv, cu, cv",
                                                 "xi, alpha (ds) or alpha, beta (eucm), fu, fv, cu, cv"};
  const YamlField intrinsics = camera.at("intrinsics", fmt::format("Write it as [{}]", kOrder[shape]));
  const std::vector<double> numbers = intrinsics.numbers();
  if (numbers.size() != shape + 4) {
    throw intrinsics.error(fmt::format("{} numbers, expected {}", numbers.size(), shape + 4),
                           fmt::format("Give {}", kOrder[shape]));
  }
  std::copy_n(numbers.begin(), shape, lens.shape.begin());
  lens.intrinsics = Eigen::Vector4d(numbers.data() + shape);

  const YamlField kind_field =
      camera.at("distortion_model", "`radtan`, `radial-tangential`, `equidistant`, `fov` or `none`");
  const std::string kind = kind_field.text();
  lens.name = model == "pinhole" ? kind : model + "-" + kind;
  const bool brown = kind == "radtan" || kind == "radial-tangential" || kind == "plumb_bob";
  const bool pinhole = model == "pinhole";
  if (kind != "none" && !(brown && shape < 2) && !(pinhole && (kind == "equidistant" || kind == "fov"))) {
    throw kind_field.error("distortion model `" + kind + "` is not supported with `" + model + "`", kRemedy);
  }
  if (kind != "none") {
    const YamlField field =
        camera.at(coefficients_key, "k1, k2, p1, p2 (radtan), k1..k4 (equidistant) or w (fov)");
    const std::vector<double> values = field.numbers();
    if (kind == "equidistant") {
      setEquidistant(field.place(), values, lens);
    } else if (brown) {
      const LensFamily family = lens.family;
      setBrown(field.place(), values, lens);
      lens.family = family;
    } else {
      // Devernay's w is an angle of view, and the model needs tan(w / 2).
      if (values.size() != 1 || !(values[0] > 0 && values[0] < std::numbers::pi)) {
        throw field.error("not one angle between 0 and pi", "Give w [rad]");
      }
      lens.family = LensFamily::kFieldOfView;
      lens.shape[0] = values[0];
    }
  }
  return acceptLens(intrinsics.place(), lens, warnings);
}

std::optional<double> readShift(const YamlField& camera, Warnings& warnings) {
  if (!camera.has("timeshift_cam_imu")) return std::nullopt;
  const YamlField field = camera.at("timeshift_cam_imu");
  return checkedShift(field.place(), field.number(), warnings);
}

double checkedShift(const InputPlace& place, double shift_s, Warnings& warnings) {
  if (std::abs(shift_s) > kShiftRefuse_s) {
    throw place.error(fmt::format("a shift of {} s", shift_s),
                      "The unit is seconds: is this in milliseconds?");
  }
  if (std::abs(shift_s) > kShiftWarn_s) {
    warnings.push_back(place.where() +
                       fmt::format(": a shift of {} s is unusually large (unit: seconds)", shift_s));
  }
  return shift_s;
}

double readReadout(const YamlField& camera) {
  bool rolls = camera.has("readout_ms");
  if (camera.has("shutter")) {
    const YamlField field = camera.at("shutter");
    const std::string shutter = field.text();
    if (shutter != "global" && shutter != "rolling") {
      throw field.error("`" + shutter + "` is not a shutter type", "Write global or rolling");
    }
    rolls = shutter == "rolling";
  }
  if (!rolls) return 0;
  const YamlField field = camera.at(
      "readout_ms", "Give the time from the first row to the last: (width + blanking) / pixel rate x rows");
  const double readout_s = kFromMs * field.number();
  if (!(readout_s > 0 && readout_s <= kReadoutRefuse_s)) {
    throw field.error(fmt::format("a readout of {} ms", field.number()),
                      "Give the milliseconds from the first row to the last, usually 5 to 60");
  }
  return readout_s;
}

ImuNoise readNoise(const YamlField& imu, const std::string& rate_key, Warnings& warnings,
                   std::vector<std::string>* left_out) {
  ImuNoise noise;
  noise.gyro_density = readPositive(imu, "gyroscope_noise_density");
  noise.accel_density = readPositive(imu, "accelerometer_noise_density");
  noise.rate_hz = readPositive(imu, rate_key);
  warnOutside(imu.at("gyroscope_noise_density"), noise.gyro_density, kGyroDensityLow, kGyroDensityHigh,
              "rad/s/sqrt(Hz)", warnings);
  warnOutside(imu.at("accelerometer_noise_density"), noise.accel_density, kAccelDensityLow, kAccelDensityHigh,
              "m/s^2/sqrt(Hz)", warnings);
  const auto walk = [&](const char* key, double high, const char* unit, double& value) {
    if (left_out != nullptr && !imu.has(key)) {
      left_out->emplace_back(key);
      return;
    }
    value = readPositive(imu, key);
    warnOutside(imu.at(key), value, 0, high, unit, warnings);
  };
  walk("gyroscope_random_walk", kGyroWalkHigh, "rad/s^2/sqrt(Hz)", noise.gyro_walk);
  walk("accelerometer_random_walk", kAccelWalkHigh, "m/s^3/sqrt(Hz)", noise.accel_walk);
  return noise;
}

}  // namespace swiftlet
