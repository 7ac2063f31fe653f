#include "drivers/simulated/calibration_rig.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "estimator/core/random.hpp"
#include "estimator/geometry/so3.hpp"

namespace swiftlet {
namespace {

constexpr std::uint64_t kRigStream = 71;
constexpr double kDeg = std::numbers::pi / 180;

struct ImageSize {
  int width;
  int height;
};
constexpr std::array<ImageSize, 7> kSizes{
    {{640, 400}, {640, 480}, {752, 480}, {848, 480}, {1024, 768}, {1280, 720}, {1280, 800}}};

// Spread between two lenses of one type: focal length, aspect of the pixels, distortion, and the principal
// point relative to the width.
constexpr double kFocalSpread = 0.005;
constexpr double kAspectSpread = 0.001;
constexpr double kDistortionSpread = 0.03;
constexpr double kCentreSpread = 0.01;
constexpr double kTangential = 3e-4;  // sigma of p1 and p2
constexpr double kLeastSlope = 0.3;   // d (distorted radius) / d (undistorted radius), anywhere in the image
constexpr double kMostTheta = 2.4;    // rad: largest angle from the axis of any lens
constexpr double kMisalignment = 0.01;   // rad, sigma per axis of camera 1 relative to camera 0
constexpr double kOffAxis = 0.02;        // sigma, relative to the baseline
constexpr double kImuMatrix = 0.005;     // sigma of each entry
constexpr double kLongestShift = 0.010;  // s

Eigen::Vector3d normalVector(Random& random) {
  const double x = random.normal();
  const double y = random.normal();
  const double z = random.normal();
  return {x, y, z};
}

// d (distorted radius) / d (undistorted radius or angle).
double radialSlope(CameraKind kind, const Eigen::Vector4d& k, double r) {
  const double r2 = r * r;
  if (kind == CameraKind::kPinholeRadtan) return 1 + r2 * (3 * k[0] + r2 * 5 * k[1]);
  return 1 + r2 * (3 * k[0] + r2 * (5 * k[1] + r2 * (7 * k[2] + r2 * 9 * k[3])));
}

double distortedRadius(CameraKind kind, const Eigen::Vector4d& k, double r) {
  const double r2 = r * r;
  if (kind == CameraKind::kPinholeRadtan) return r * (1 + r2 * (k[0] + r2 * k[1]));
  return r * (1 + r2 * (k[0] + r2 * (k[1] + r2 * (k[2] + r2 * k[3]))));
}

// Whether the lens maps every pixel to a ray, with a margin of the slope.
bool validEverywhere(const CameraModel& camera) {
  constexpr int kSteps = 32;
  for (int i = 0; i <= kSteps; ++i) {
    for (int j = 0; j <= kSteps; ++j) {
      if (i % kSteps != 0 && j % kSteps != 0) continue;  // the border is the farthest from the axis
      const Eigen::Vector2d pixel((camera.width() - 1.0) * i / kSteps, (camera.height() - 1.0) * j / kSteps);
      Eigen::Vector3d ray;
      if (!camera.unproject(pixel, ray)) return false;
      const double theta = std::atan2(ray.head<2>().norm(), ray.z());
      const double radius = camera.kind() == CameraKind::kPinholeRadtan ? std::tan(theta) : theta;
      if (theta > kMostTheta || radialSlope(camera.kind(), camera.distortion(), radius) < kLeastSlope)
        return false;
    }
  }
  return true;
}

Eigen::Vector4d drawDistortion(Random& random, CameraKind kind, double edge) {
  Eigen::Vector4d k;
  if (kind == CameraKind::kPinholeRadtan) {
    // Barrel distortion with two terms balanced as in real lenses: monotonic at every radius.
    k[0] = random.uniform(-0.35, -0.02);
    k[1] = random.uniform(0.7, 1.1) * k[0] * k[0];
    k[2] = kTangential * random.normal();
    k[3] = kTangential * random.normal();
    return k;
  }
  // Each term by its effect at the edge of the image, `edge` rad from the axis.
  constexpr std::array<double, 4> kAtEdge{0.10, 0.04, 0.02, 0.01};
  double power = 1;
  for (int i = 0; i < 4; ++i) {
    power *= edge * edge;
    const double most = kAtEdge[static_cast<std::size_t>(i)];
    k[i] = random.uniform(-most, most) / power;
  }
  return k;
}

CameraModel drawCamera(Random& random, CameraKind kind, const ImageSize& size, double focal,
                       const Eigen::Vector4d& distortion) {
  const double fx = focal * (1 + kFocalSpread * random.normal());
  const double fy = fx * (1 + kAspectSpread * random.normal());
  const double cx = 0.5 * (size.width - 1) + kCentreSpread * size.width * random.normal();
  const double cy = 0.5 * (size.height - 1) + kCentreSpread * size.width * random.normal();
  Eigen::Vector4d own = distortion;
  for (int i = 0; i < 4; ++i) own[i] *= 1 + kDistortionSpread * random.normal();
  return {kind, size.width, size.height, {fx, fy, cx, cy}, own};
}

}  // namespace

CalibrationRig drawCalibrationRig(std::uint64_t seed, CameraKind lens) {
  Random random(seed, kRigStream);
  CalibrationRig drawn;
  Rig& rig = drawn.rig;
  rig.camera_count = 2;
  const ImageSize size = kSizes[random.below(kSizes.size())];
  const bool pinhole = lens == CameraKind::kPinholeRadtan;
  const double edge = 0.5 * kDeg * (pinhole ? random.uniform(60, 100) : random.uniform(100, 190));
  do {
    const Eigen::Vector4d distortion = drawDistortion(random, lens, edge);
    const double radius = distortedRadius(lens, distortion, pinhole ? std::tan(edge) : edge);
    const double focal = 0.5 * size.width / radius;
    rig.camera[0] = drawCamera(random, lens, size, focal, distortion);
    rig.camera[1] = drawCamera(random, lens, size, focal, distortion);
  } while (!validEverywhere(rig.camera[0]) || !validEverywhere(rig.camera[1]));

  const double baseline = random.uniform(0.03, 0.30);
  const Eigen::Vector3d turn = kMisalignment * normalVector(random);
  const Eigen::Vector3d aside = Eigen::Vector3d::UnitX() + kOffAxis * normalVector(random);
  const SE3 T_cam0_cam1(expSo3(turn), baseline * aside.normalized());
  Eigen::Vector4d any;  // uniform over the unit quaternions
  for (int i = 0; i < 4; ++i) any[i] = random.normal();
  const Eigen::Vector3d direction = normalVector(random).normalized();
  rig.T_body_cam[0] = SE3(Eigen::Quaterniond(any.normalized()), random.uniform(0.01, 0.10) * direction);
  rig.T_body_cam[1] = rig.T_body_cam[0] * T_cam0_cam1;
  rig.camera_to_imu_shift = Duration::fromSeconds(random.uniform(-kLongestShift, kLongestShift));
  const bool rolling = random.below(2) == 1;
  const double readout = random.uniform(0.005, 0.025);
  if (rolling) rig.readout = Duration::fromSeconds(readout);

  // Densities as published with the two data sets.
  if (random.below(2) == 0) {
    drawn.noise.gyro_density = 1.6968e-4;
    drawn.noise.accel_density = 2.0e-3;
    drawn.noise.gyro_walk = 1.9393e-5;
    drawn.noise.accel_walk = 3.0e-3;
  } else {
    drawn.noise.gyro_density = 1.6e-4;
    drawn.noise.accel_density = 2.8e-3;
    drawn.noise.gyro_walk = 2.2e-5;
    drawn.noise.accel_walk = 8.6e-4;
  }
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      drawn.gyro_matrix(i, j) += kImuMatrix * random.normal();
      if (j <= i) drawn.accel_matrix(i, j) += kImuMatrix * random.normal();
    }
  }
  return drawn;
}

CalibrationRig makeCalibrationRig(RigKind kind, std::uint64_t seed) {
  if (kind == RigKind::kRandomPinhole) return drawCalibrationRig(seed, CameraKind::kPinholeRadtan);
  if (kind == RigKind::kRandomFisheye) return drawCalibrationRig(seed, CameraKind::kEquidistant);
  CalibrationRig preset;
  preset.rig = makeRig(kind).rig;
  return preset;
}

}  // namespace swiftlet
