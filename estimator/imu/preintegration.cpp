#include "estimator/imu/preintegration.hpp"

#include <algorithm>

#include "estimator/geometry/so3.hpp"
#include "estimator/imu/integration_rule.hpp"

namespace swiftlet {
namespace {

// hat(a) M without forming hat(a).
Eigen::Matrix3d cross(const Eigen::Vector3d& a, const Eigen::Matrix3d& m) {
  Eigen::Matrix3d out;
  out.row(0) = a.y() * m.row(2) - a.z() * m.row(1);
  out.row(1) = a.z() * m.row(0) - a.x() * m.row(2);
  out.row(2) = a.x() * m.row(1) - a.y() * m.row(0);
  return out;
}

}  // namespace

Preintegration::Preintegration(const ImuNoise& noise, const Eigen::Vector3d& bias_gyro,
                               const Eigen::Vector3d& bias_accel, const GyroIntrinsics& intrinsics)
    : noise_(noise), bias_gyro_(bias_gyro), bias_accel_(bias_accel), intrinsics_(intrinsics) {}

void Preintegration::integrate(double dt, const Eigen::Vector3d& gyro, const Eigen::Vector3d& accel,
                               double gyro_factor, double accel_factor) {
  const Eigen::Matrix3d R = rotation_.toRotationMatrix();
  const IntegrationStep step = integrationStep((intrinsics_.rate(gyro) - bias_gyro_) * dt);
  const Eigen::Quaterniond middle = rotation_ * step.half;
  const Eigen::Matrix3d R_half = middle.toRotationMatrix();
  const Eigen::Vector3d force = R_half * (accel - bias_accel_);

  propagateCovariance(dt, force, gyro_factor * noise_.gyro_density * noise_.gyro_density * dt,
                      accel_factor * noise_.accel_density * noise_.accel_density * dt);

  // The bias rotates the middle attitude by d theta_half; p follows v by the trapezoid rule.
  const Eigen::Matrix3d theta_half = theta_gyro_ - (0.5 * dt) * R * step.half_left_jacobian;
  const Eigen::Matrix3d v_gyro_before = v_gyro_;
  v_gyro_ -= cross(dt * force, theta_half);
  p_gyro_ += (0.5 * dt) * (v_gyro_before + v_gyro_);
  theta_gyro_ -= dt * R * step.left_jacobian;
  p_accel_ += dt * v_accel_ - (0.5 * dt * dt) * R_half;
  v_accel_ -= dt * R_half;

  position_ += velocity_ * dt + 0.5 * dt * dt * force;
  velocity_ += dt * force;
  rotation_ = (middle * step.half).normalized();
  gyro_integral_ += dt * gyro;
  duration_ += dt;
}

void Preintegration::propagateCovariance(double dt, const Eigen::Vector3d& force, double gyro_variance,
                                         double accel_variance) {
  // theta' = theta + w,  v' = v - dt f x (theta + w / 2) + n dt,  p' = p + dt (v + v') / 2.
  // Half of w's variance is added before and half after: the covariances of theta and v are then exact,
  // except that v's is too large by a negligible dt^3 f^2 gyro_density^2 / 4.
  const Eigen::Vector3d a = -dt * force;
  cov_.theta_theta.diagonal().array() += 0.5 * gyro_variance;
  const Eigen::Matrix3d f_theta = cross(a, cov_.theta_theta);      // cov(a x theta, theta)
  const Eigen::Matrix3d f_v = cross(a, cov_.v_theta.transpose());  // cov(a x theta, v)
  const Eigen::Matrix3d f_p = cross(a, cov_.p_theta.transpose());  // cov(a x theta, p)
  const Eigen::Matrix3d f_f = cross(a, f_theta.transpose());       // cov(a x theta, a x theta)
  const Eigen::Matrix3d v_vnew = cov_.v_v + f_v.transpose();       // cov(v, v')
  const Eigen::Matrix3d p_vnew = cov_.p_v + f_p.transpose();       // cov(p, v')
  Eigen::Matrix3d vnew_vnew = v_vnew + f_v + f_f;
  vnew_vnew.diagonal().array() += accel_variance;
  const Eigen::Matrix3d v_theta = cov_.v_theta + f_theta;
  const double h = 0.5 * dt;
  cov_.p_theta += h * (cov_.v_theta + v_theta);
  const Eigen::Matrix3d p_sum = cov_.p_v + p_vnew;  // cov(p, v + v')
  cov_.p_p +=
      h * (p_sum + p_sum.transpose()) + (h * h) * (cov_.v_v + v_vnew + v_vnew.transpose() + vnew_vnew);
  // White acceleration within the step: int t^2 = dt^3 / 3, of which the trapezoid rule contains dt^3 / 4.
  // Without the rest the covariance of a single step would be singular.
  cov_.p_p.diagonal().array() += accel_variance * dt * dt / 12.0;
  cov_.p_v = p_vnew + h * (v_vnew + vnew_vnew);
  cov_.v_v = vnew_vnew;
  cov_.v_theta = v_theta;
  cov_.theta_theta.diagonal().array() += 0.5 * gyro_variance;
}

void Preintegration::bridgeGap(double dt, const Eigen::Vector3d& accel) {
  const Eigen::Matrix3d R = rotation_.toRotationMatrix();
  const Eigen::Vector3d force = R * (accel - bias_accel_);
  // The unknown rotation in the gap does not rotate the force: a hovering body pushes up whatever its
  // attitude was. So the rate's variance is added after the step.
  propagateCovariance(dt, force, 0, kGapAccelDensity * kGapAccelDensity * dt);
  cov_.theta_theta.diagonal().array() += kGapGyroDensity * kGapGyroDensity * dt;
  const Eigen::Matrix3d v_gyro_before = v_gyro_;
  v_gyro_ -= cross(dt * force, theta_gyro_);
  p_gyro_ += (0.5 * dt) * (v_gyro_before + v_gyro_);
  p_accel_ += dt * v_accel_ - (0.5 * dt * dt) * R;
  v_accel_ -= dt * R;
  position_ += velocity_ * dt + 0.5 * dt * dt * force;
  velocity_ += dt * force;
  duration_ += dt;
  gap_duration_ += dt;
}

Status Preintegration::integrate(std::span<const ImuSample> samples, Stamp from, Stamp to) {
  if (samples.empty()) return {StatusCode::kInvalidInput, "no IMU sample in the interval"};
  const auto after = [](Stamp stamp, const ImuSample& s) { return stamp < s.stamp; };
  auto next = static_cast<std::size_t>(std::upper_bound(samples.begin(), samples.end(), from, after) -
                                       samples.begin());
  Stamp at = from;
  while (at < to) {
    const ImuSample* left = next > 0 ? &samples[next - 1] : nullptr;
    const ImuSample* right = next < samples.size() ? &samples[next] : nullptr;
    const Stamp end = right != nullptr && right->stamp < to ? right->stamp : to;
    const ImuSegment segment = makeSegment(left, right, at, end, noise_);
    if (segment.gap) {
      bridgeGap(segment.dt, segment.accel);
    } else {
      integrate(segment.dt, segment.gyro, segment.accel, segment.gyro_factor, segment.accel_factor);
    }
    at = end;
    ++next;
  }
  return okStatus();
}

Matrix9d Preintegration::covariance() const {
  const Eigen::Matrix3d Rt = rotation_.toRotationMatrix().transpose();
  Matrix9d out;
  out.block<3, 3>(0, 0) = Rt * cov_.theta_theta * Rt.transpose();
  out.block<3, 3>(3, 0) = cov_.p_theta * Rt.transpose();
  out.block<3, 3>(6, 0) = cov_.v_theta * Rt.transpose();
  out.block<3, 3>(0, 3) = out.block<3, 3>(3, 0).transpose();
  out.block<3, 3>(0, 6) = out.block<3, 3>(6, 0).transpose();
  out.block<3, 3>(3, 3) = cov_.p_p;
  out.block<3, 3>(3, 6) = cov_.p_v;
  out.block<3, 3>(6, 3) = cov_.p_v.transpose();
  out.block<3, 3>(6, 6) = cov_.v_v;
  return out;
}

Eigen::Quaterniond Preintegration::deltaRotation(const Eigen::Vector3d& bias_gyro) const {
  return (expSo3(theta_gyro_ * (bias_gyro - bias_gyro_)) * rotation_).normalized();
}

Eigen::Vector3d Preintegration::deltaVelocity(const Eigen::Vector3d& bias_gyro,
                                              const Eigen::Vector3d& bias_accel) const {
  return velocity_ + v_gyro_ * (bias_gyro - bias_gyro_) + v_accel_ * (bias_accel - bias_accel_);
}

Eigen::Vector3d Preintegration::deltaPosition(const Eigen::Vector3d& bias_gyro,
                                              const Eigen::Vector3d& bias_accel) const {
  return position_ + p_gyro_ * (bias_gyro - bias_gyro_) + p_accel_ * (bias_accel - bias_accel_);
}

Eigen::Matrix<double, 9, 3> Preintegration::jacobianGyro() const {
  Eigen::Matrix<double, 9, 3> out;
  out.topRows<3>() = rotation_.toRotationMatrix().transpose() * theta_gyro_;
  out.middleRows<3>(3) = p_gyro_;
  out.bottomRows<3>() = v_gyro_;
  return out;
}

Eigen::Matrix<double, 9, 3> Preintegration::jacobianAccel() const {
  Eigen::Matrix<double, 9, 3> out = Eigen::Matrix<double, 9, 3>::Zero();
  out.middleRows<3>(3) = p_accel_;
  out.bottomRows<3>() = v_accel_;
  return out;
}

}  // namespace swiftlet
