#include "estimator/imu/integration_rule.hpp"

#include "estimator/geometry/so3.hpp"

namespace swiftlet {
namespace {

// Up to this squared angle (0.1 rad a step) the series below are exact to 1e-12.
constexpr double kSeriesAngleSquared = 0.01;

Eigen::Matrix3d leftJacobianSeries(const Eigen::Vector3d& phi, double angle_squared) {
  const double a = 0.5 - angle_squared * (1.0 / 24.0 - angle_squared / 720.0);
  const double b = 1.0 / 6.0 - angle_squared * (1.0 / 120.0 - angle_squared / 5040.0);
  Eigen::Matrix3d jacobian = b * phi * phi.transpose();  // hat^2 = phi phi' - |phi|^2 I
  jacobian.diagonal().array() += 1.0 - b * angle_squared;
  const Eigen::Vector3d s = a * phi;
  jacobian(0, 1) -= s.z();
  jacobian(1, 0) += s.z();
  jacobian(0, 2) += s.y();
  jacobian(2, 0) -= s.y();
  jacobian(1, 2) -= s.x();
  jacobian(2, 1) += s.x();
  return jacobian;
}

bool saturated(const Eigen::Vector3d& reading, double limit) {
  return reading.cwiseAbs().maxCoeff() >= limit;
}

}  // namespace

IntegrationStep integrationStep(const Eigen::Vector3d& rotation) {
  const double angle_squared = rotation.squaredNorm();
  if (angle_squared > kSeriesAngleSquared) {
    return {expSo3(0.5 * rotation), rightJacobianSo3(-rotation), rightJacobianSo3(-0.5 * rotation)};
  }
  const double h = 0.25 * angle_squared * 0.25;  // (half rotation's half angle)^2
  const double real = 1.0 - h * (0.5 - h * (1.0 / 24.0 - h / 720.0));
  const double imaginary = 0.25 * (1.0 - h * (1.0 / 6.0 - h * (1.0 / 120.0 - h / 5040.0)));
  return {{real, imaginary * rotation.x(), imaginary * rotation.y(), imaginary * rotation.z()},
          leftJacobianSeries(rotation, angle_squared),
          leftJacobianSeries(0.5 * rotation, 0.25 * angle_squared)};
}

ImuSegment makeSegment(const ImuSample* before, const ImuSample* after, Stamp from, Stamp to,
                       const ImuNoise& noise) {
  ImuSegment segment;
  segment.dt = (to - from).seconds();
  double covered = 0;  // s of motion that the two readings represent
  if (before != nullptr && after != nullptr) {
    covered = (after->stamp - before->stamp).seconds();
    const double middle = (from - before->stamp).seconds() + 0.5 * segment.dt;
    const double s = covered > 0 ? middle / covered : 0.0;
    segment.gyro = before->gyro + s * (after->gyro - before->gyro);
    segment.accel = before->accel + s * (after->accel - before->accel);
  } else {
    const ImuSample& only = before != nullptr ? *before : *after;
    covered = before != nullptr ? (to - before->stamp).seconds() : (after->stamp - from).seconds();
    segment.gyro = only.gyro;
    segment.accel = only.accel;
  }
  const double periods = covered * noise.rate_hz;
  segment.gap = periods > kGapPeriods;
  if (periods > kRegularPeriods) segment.gyro_factor = segment.accel_factor = periods * periods;
  for (const ImuSample* sample : {before, after}) {
    if (sample == nullptr) continue;
    if (saturated(sample->gyro, noise.gyro_saturation)) segment.gyro_factor = kSaturatedVarianceFactor;
    if (saturated(sample->accel, noise.accel_saturation)) segment.accel_factor = kSaturatedVarianceFactor;
  }
  return segment;
}

}  // namespace swiftlet
