// The stage at IMU rate: its covariance follows what the flight shows of the IMU.

#include "estimator/odometry/propagation_stage.hpp"

#include <catch2/catch.hpp>

using namespace swiftlet;

namespace {

constexpr double kSamplePeriod = 5e-3;  // s

StateFix fixAt(double seconds) {
  StateFix fix;
  fix.has_state = true;
  fix.state.stamp = Stamp{Duration::fromSeconds(seconds).ns};
  fix.state.covariance.setIdentity();
  fix.state.covariance *= 1e-8;
  return fix;
}

/// Variance of the velocity after 0.5 s at rest, with `clipped` as the reading of the x axis (m/s^2), if not
/// zero.
double variance(const ImuFactors& factors, double clipped) {
  PropagationStage stage(ImuNoise{}, OdometrySettings{});
  StateFix fix = fixAt(0);
  fix.imu = factors;
  NavState state;
  for (int k = 0; k <= 100; ++k) {
    ImuSample sample{Stamp{Duration::fromSeconds(k * kSamplePeriod).ns}, Eigen::Vector3d(1e-3 * k, 0, 0),
                     Eigen::Vector3d(1e-3 * k, 0, 9.81)};
    if (clipped != 0) sample.accel.x() = clipped;
    static_cast<void>(stage.step(sample, &state));
    if (k == 0) stage.take(fix);
  }
  return state.covariance(6, 6);
}

}  // namespace

TEST_CASE("Propagation: noise found in flight is in the covariance between fixes", "[odometry]") {
  const double nominal = variance({1, 1}, 0);
  CHECK(variance({1, 10}, 0) / nominal == Approx(100).epsilon(0.2));
  CHECK(variance({10, 1}, 0) > 1.01 * nominal);
}

TEST_CASE("Propagation: an axis that is clipped below the calibration's limit is not believed",
          "[odometry]") {
  CHECK(variance({1, 1}, 50.0) > 30 * variance({1, 1}, 0));
}
