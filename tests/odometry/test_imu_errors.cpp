// An IMU that errs otherwise than its calibration says: what it errs by is found, and weighted.

#include <catch2/catch.hpp>
#include <cmath>

#include "estimator/smoother/imu_excess.hpp"
#include "tests/odometry/odometry_run.hpp"

using namespace swiftlet;
using test::OdometryRun;
using test::RunFrame;
using test::TrackFlight;

namespace {

// `flown`: the IMU that flies; what is told is the calibration of roomFlight.
template <typename Spoil>
OdometryRun fly(const Spoil& spoil, const OdometrySettings& given = {}) {
  SimulationSettings settings = test::roomFlight(20, 78);
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

TEST_CASE("Odometry: a gyro's scale and misalignment are found", "[odometry]") {
  Eigen::Matrix3d error;
  error << 0.01, 0.004, 0, 0, -0.01, 0, -0.005, 0, 0.006;
  const auto spoil = [&](ImuSimulationSettings& imu) { imu.gyro_matrix += error; };
  const OdometryRun run = fly(spoil);
  const Eigen::Matrix3d found = run.frames.back().calibration.gyro.matrix;
  CHECK((found - error).norm() < 0.4 * error.norm());
  OdometrySettings given;
  given.estimate_gyro = false;
  const OdometryRun without = fly(spoil, given);
  CHECK(without.frames.back().calibration.gyro.matrix.isZero());
  CHECK(test::ate(run.frames, 6) < test::ate(without.frames, 6));
}
