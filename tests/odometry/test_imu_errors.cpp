// An IMU that errs otherwise than its calibration says: what it errs by is found, and weighted.

#include <Eigen/Cholesky>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdio>

#include "estimator/smoother/imu_excess.hpp"
#include "tests/odometry/odometry_run.hpp"

using namespace swiftlet;
using test::OdometryRun;
using test::RunFrame;
using test::TrackFlight;

namespace {

/// `spoil` makes the IMU that flies; what is told is the calibration of roomFlight.
template <typename Spoil>
OdometryRun fly(const Spoil& spoil, const OdometrySettings& given = {}, std::uint64_t seed = 78) {
  SimulationSettings settings = test::roomFlight(20, seed);
  const ImuNoise told = settings.imu.noise;
  spoil(settings.imu);
  const TrackFlight flight(settings);
  OdometrySettings odometry = given;
  odometry.gyro_inflation = 1;
  odometry.accel_inflation = 1;
  return test::runOdometry(flight, odometry, 0, 0.5, told);
}

}  // namespace

TEST_CASE("IMU excess: what smoothing leaves of a noise gives its factor", "[odometry]") {
  for (const double noise : {1.0, 2.0, 6.0, 20.0}) {
    CAPTURE(noise);
    ImuExcess excess;
    for (int k = 0; k < 400; ++k) {
      const double square = excess.factors().gyro * excess.factors().gyro;
      excess.update({0, noise * noise * square / (square + 3), 0}, 0.05);
    }
    CHECK(excess.factors().gyro == Approx(noise).epsilon(0.02));
    CHECK(excess.factors().accel == 1);
  }
  ImuExcess excess;
  for (int k = 0; k < 400; ++k) excess.update({0, 1e9, 1e9}, 0.05);
  CHECK(excess.factors().gyro <= ImuExcess::kMostRaised);
  CHECK(excess.factors().accel <= ImuExcess::kMostRaised);
}

TEST_CASE("Odometry: a gyro ten times as noisy as told is found to be so", "[odometry]") {
  const OdometryRun as_told = fly([](ImuSimulationSettings&) {});
  CHECK(as_told.frames.back().statistics.noise.imu.gyro < 1.5);
  CHECK(as_told.frames.back().statistics.noise.imu.accel < 1.5);
  const OdometryRun noisy = fly([](ImuSimulationSettings& imu) { imu.noise.gyro_density *= 10; });
  CHECK(noisy.frames.back().statistics.noise.imu.gyro == Approx(10).epsilon(0.4));
  CHECK(noisy.frames.back().state.health == Health::kGood);
}

// A steady turn looks the same with another bias and another matrix: only their priors tell the two apart.
TEST_CASE("Odometry: gyro bias and matrix do not drift apart", "[odometry]") {
  for (const std::uint64_t seed : {101, 124}) {
    CAPTURE(seed);
    const TrackFlight flight(test::roomFlight(6, seed));
    const OdometryRun run = test::runOdometry(flight, test::settingsFor(flight, false));
    REQUIRE(run.frames.back().has_state);
    for (const RunFrame& frame : run.frames) {
      if (!frame.has_state) continue;
      const Eigen::Vector3d error = frame.state.bias_gyro - frame.truth.bias_gyro;
      const Eigen::Matrix3d P = frame.state.covariance.block<3, 3>(9, 9);
      CAPTURE(frame.seconds);
      CHECK(error.dot(P.llt().solve(error)) < 30);  // chi-squared, 3 degrees: 2e-6 are beyond
    }
  }
}

TEST_CASE("Odometry: a gyro's scale and misalignment are found", "[odometry]") {
  Eigen::Matrix3d error;
  error << 0.01, 0.004, 0, 0, -0.01, 0, -0.005, 0, 0.006;
  const auto spoil = [&](ImuSimulationSettings& imu) { imu.gyro_matrix += error; };
  OdometrySettings given;
  given.estimate_gyro = false;
  // What one flight leaves is chance, and changes with rounding.
  constexpr int kFlights = 4;
  double left = 0, with = 0, without = 0;
  for (std::uint64_t seed = 78; seed < 78 + kFlights; ++seed) {
    const OdometryRun run = fly(spoil, {}, seed);
    left += (run.frames.back().calibration.gyro.matrix - error).norm() / kFlights;
    with += test::ate(run.frames, 6) / kFlights;
    const OdometryRun as_told = fly(spoil, given, seed);
    CHECK(as_told.frames.back().calibration.gyro.matrix.isZero());
    without += test::ate(as_told.frames, 6) / kFlights;
  }
  std::printf("gyro matrix: %.2f of the error left, ATE %.4f m, not estimated %.4f m\n", left / error.norm(),
              with, without);
  CHECK(left < 0.55 * error.norm());  // in 20 s
  CHECK(with < without);
}
