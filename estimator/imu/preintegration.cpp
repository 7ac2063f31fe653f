#include "estimator/imu/preintegration.hpp"

#include <algorithm>

#include "estimator/geometry/so3.hpp"

namespace swiftlet {
namespace {

struct Reading {
  Eigen::Vector3d gyro;
  Eigen::Vector3d accel;
};

Reading interpolate(const ImuSample& a, const ImuSample& b, Stamp at) {
  const double span = (b.stamp - a.stamp).seconds();
  const double s = span > 0 ? (at - a.stamp).seconds() / span : 0.0;
  return {a.gyro + s * (b.gyro - a.gyro), a.accel + s * (b.accel - a.accel)};
}

}  // namespace

Preintegration::Preintegration(const ImuNoise& noise, const Eigen::Vector3d& bias_gyro,
                               const Eigen::Vector3d& bias_accel)
    : gyro_variance_density_(noise.gyro_density * noise.gyro_density),
      accel_variance_density_(noise.accel_density * noise.accel_density),
      bias_gyro_(bias_gyro),
      bias_accel_(bias_accel) {}

void Preintegration::integrate(double dt, const Eigen::Vector3d& gyro, const Eigen::Vector3d& accel) {
  const Eigen::Vector3d phi = (gyro - bias_gyro_) * dt;
  const Eigen::Vector3d a = accel - bias_accel_;
  const Eigen::Quaterniond half = expSo3(0.5 * phi);
  const Eigen::Matrix3d R = rotation_.toRotationMatrix();
  const Eigen::Matrix3d R_half = (rotation_ * half).toRotationMatrix();
  const Eigen::Matrix3d step = expSo3Matrix(phi);
  const Eigen::Matrix3d right_jacobian = rightJacobianSo3(phi);
  const Eigen::Vector3d force = R_half * a;

  // d(R_half a)/d(phi of R) = -R hat(Exp(half) a), and through the half step's own rate.
  const Eigen::Matrix3d force_phi = -R * hat(half * a);
  const Eigen::Matrix3d force_gyro = R_half * hat(a) * (rightJacobianSo3(0.5 * phi) * (0.5 * dt));

  Matrix9d A = Matrix9d::Identity();
  A.block<3, 3>(0, 0) = step.transpose();
  A.block<3, 3>(3, 0) = 0.5 * dt * dt * force_phi;
  A.block<3, 3>(3, 6) = dt * Eigen::Matrix3d::Identity();
  A.block<3, 3>(6, 0) = dt * force_phi;
  Eigen::Matrix<double, 9, 3> B_gyro;  // d increment / d gyro bias (bias enters with a minus)
  B_gyro.topRows<3>() = -right_jacobian * dt;
  B_gyro.middleRows<3>(3) = 0.5 * dt * dt * force_gyro;
  B_gyro.bottomRows<3>() = dt * force_gyro;
  Eigen::Matrix<double, 9, 3> B_accel = Eigen::Matrix<double, 9, 3>::Zero();
  B_accel.middleRows<3>(3) = -0.5 * dt * dt * R_half;
  B_accel.bottomRows<3>() = -dt * R_half;

  // White noise of density s over dt has the mean's variance s^2 / dt.
  covariance_ = A * covariance_ * A.transpose() +
                (gyro_variance_density_ / dt) * B_gyro * B_gyro.transpose() +
                (accel_variance_density_ / dt) * B_accel * B_accel.transpose();
  jacobian_gyro_ = A * jacobian_gyro_ + B_gyro;
  jacobian_accel_ = A * jacobian_accel_ + B_accel;

  position_ += velocity_ * dt + 0.5 * dt * dt * force;
  velocity_ += dt * force;
  rotation_ = (rotation_ * expSo3(phi)).normalized();
  duration_ += dt;
}

Status Preintegration::integrate(std::span<const ImuSample> samples, Stamp from, Stamp to) {
  if (samples.empty()) return {StatusCode::kInvalidInput, "no IMU sample in the interval"};
  const auto reading_at = [&](std::size_t next, Stamp at) -> Reading {
    if (next == 0) return {samples.front().gyro, samples.front().accel};
    if (next == samples.size()) return {samples.back().gyro, samples.back().accel};
    return interpolate(samples[next - 1], samples[next], at);
  };
  const auto after = [](Stamp stamp, const ImuSample& s) { return stamp < s.stamp; };
  auto next = static_cast<std::size_t>(std::upper_bound(samples.begin(), samples.end(), from, after) -
                                       samples.begin());
  Stamp at = from;
  Reading reading = reading_at(next, at);
  while (at < to) {
    const bool more = next < samples.size() && samples[next].stamp < to;
    const Stamp end = more ? samples[next].stamp : to;
    const Reading end_reading =
        more ? Reading{samples[next].gyro, samples[next].accel} : reading_at(next, to);
    integrate((end - at).seconds(), 0.5 * (reading.gyro + end_reading.gyro),
              0.5 * (reading.accel + end_reading.accel));
    at = end;
    reading = end_reading;
    if (more) ++next;
  }
  return okStatus();
}

Eigen::Quaterniond Preintegration::deltaRotation(const Eigen::Vector3d& bias_gyro) const {
  return (rotation_ * expSo3(jacobian_gyro_.topRows<3>() * (bias_gyro - bias_gyro_))).normalized();
}

Eigen::Vector3d Preintegration::deltaVelocity(const Eigen::Vector3d& bias_gyro,
                                              const Eigen::Vector3d& bias_accel) const {
  return velocity_ + jacobian_gyro_.bottomRows<3>() * (bias_gyro - bias_gyro_) +
         jacobian_accel_.bottomRows<3>() * (bias_accel - bias_accel_);
}

Eigen::Vector3d Preintegration::deltaPosition(const Eigen::Vector3d& bias_gyro,
                                              const Eigen::Vector3d& bias_accel) const {
  return position_ + jacobian_gyro_.middleRows<3>(3) * (bias_gyro - bias_gyro_) +
         jacobian_accel_.middleRows<3>(3) * (bias_accel - bias_accel_);
}

}  // namespace swiftlet
