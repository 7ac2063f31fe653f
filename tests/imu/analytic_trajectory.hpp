#pragma once
// A flight given by formulas, so that pose, velocity, body rate and specific force are exact at any
// time: position and rotation vector are sums of sines; the body rate is Jr(phi) phi'.

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <vector>

#include "estimator/core/random.hpp"
#include "estimator/imu/imu_noise.hpp"
#include "estimator/messages/imu_sample.hpp"

namespace swiftlet::test {

class AnalyticTrajectory {
 public:
  /// `speed` and `rate` scale translation and rotation; 1 is brisk flight (2 m/s, 1 rad/s).
  explicit AnalyticTrajectory(std::uint64_t seed, double speed = 1, double rate = 1);

  [[nodiscard]] Eigen::Vector3d position(double t) const { return position_.at(t, 0); }
  [[nodiscard]] Eigen::Vector3d velocity(double t) const { return position_.at(t, 1); }
  [[nodiscard]] Eigen::Vector3d acceleration(double t) const { return position_.at(t, 2); }
  [[nodiscard]] Eigen::Quaterniond rotation(double t) const;
  [[nodiscard]] Eigen::Vector3d bodyRate(double t) const;
  [[nodiscard]] Eigen::Vector3d specificForce(double t, double gravity) const;

  /// Samples over [from, to] at `noise.rate_hz`, with white noise when `random` is given.
  [[nodiscard]] std::vector<ImuSample> samples(double from, double to, const ImuNoise& noise,
                                               const Eigen::Vector3d& bias_gyro,
                                               const Eigen::Vector3d& bias_accel, Random* random) const;

 private:
  struct Sines {
    static constexpr int kTerms = 3;
    std::array<Eigen::Vector3d, kTerms> amplitude, frequency, phase;
    [[nodiscard]] Eigen::Vector3d at(double t, int derivative) const;
  };
  Sines position_, rotation_;
};

inline Stamp stampOf(double seconds) { return {Duration::fromSeconds(seconds).ns}; }

inline Eigen::Vector3d normalVector(Random& random) {
  const double x = random.normal(), y = random.normal(), z = random.normal();
  return {x, y, z};
}

}  // namespace swiftlet::test
