#include "tests/imu/analytic_trajectory.hpp"

#include <cmath>
#include <numbers>

#include "estimator/geometry/so3.hpp"

namespace swiftlet::test {

Eigen::Vector3d AnalyticTrajectory::Sines::at(double t, int derivative) const {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < kTerms; ++i) {
    for (int axis = 0; axis < 3; ++axis) {
      const double w = frequency[i][axis];
      const double angle = w * t + phase[i][axis] + derivative * std::numbers::pi / 2;  // sin' = sin(+90)
      sum[axis] += amplitude[i][axis] * std::pow(w, derivative) * std::sin(angle);
    }
  }
  return sum;
}

AnalyticTrajectory::AnalyticTrajectory(std::uint64_t seed, double speed, double rate) {
  Random random(seed, 77);
  for (std::size_t i = 0; i < Sines::kTerms; ++i) {
    const double base = 0.7 * static_cast<double>(i + 1);  // rad/s
    for (int axis = 0; axis < 3; ++axis) {
      position_.frequency[i][axis] = base * random.uniform(0.8, 1.4);
      position_.phase[i][axis] = random.uniform(0, 2 * std::numbers::pi);
      position_.amplitude[i][axis] = speed * random.uniform(0.3, 1.0) / position_.frequency[i][axis];
      rotation_.frequency[i][axis] = base * random.uniform(0.8, 1.4);
      rotation_.phase[i][axis] = random.uniform(0, 2 * std::numbers::pi);
      rotation_.amplitude[i][axis] = rate * random.uniform(0.1, 0.5) / rotation_.frequency[i][axis];
    }
  }
}

Eigen::Quaterniond AnalyticTrajectory::rotation(double t) const { return expSo3(rotation_.at(t, 0)); }

Eigen::Vector3d AnalyticTrajectory::bodyRate(double t) const {
  return rightJacobianSo3(rotation_.at(t, 0)) * rotation_.at(t, 1);
}

Eigen::Vector3d AnalyticTrajectory::specificForce(double t, double gravity) const {
  return rotation(t).conjugate() * (acceleration(t) + Eigen::Vector3d(0, 0, gravity));
}

std::vector<ImuSample> AnalyticTrajectory::samples(double from, double to, const ImuNoise& noise,
                                                   const Eigen::Vector3d& bias_gyro,
                                                   const Eigen::Vector3d& bias_accel, Random* random) const {
  std::vector<ImuSample> out;
  const double root_rate = std::sqrt(noise.rate_hz);
  const auto count = static_cast<int>(std::lround((to - from) * noise.rate_hz));
  for (int i = 0; i <= count; ++i) {
    const double t = from + i / noise.rate_hz;
    ImuSample sample{stampOf(t), bodyRate(t) + bias_gyro, specificForce(t, noise.gravity) + bias_accel};
    if (random != nullptr) {
      sample.gyro += noise.gyro_density * root_rate * normalVector(*random);
      sample.accel += noise.accel_density * root_rate * normalVector(*random);
    }
    out.push_back(sample);
  }
  return out;
}

}  // namespace swiftlet::test
