#include <catch2/catch.hpp>
#include <cmath>

#include "drivers/simulated/flight_path.hpp"
#include "drivers/simulated/imu_simulator.hpp"
#include "estimator/geometry/so3.hpp"
#include "estimator/imu/preintegration.hpp"

namespace swiftlet {
namespace {

SplineTrajectory testFlight(double duration, double rest = 0) {
  FlightSettings settings;
  settings.duration = duration;
  settings.rest_at_start = rest;
  settings.R_flu_body = eurocBodyAxes();
  return flyTour({{{2, 2, 1.5}, {-2, 2, 1.2}, {-2, -2, 1.8}, {2, -2, 1.4}}, 0.0}, settings);
}

TEST_CASE("noise-free readings integrate to the truth") {
  const SplineTrajectory trajectory = testFlight(10);
  ImuSimulationSettings settings;
  settings.noise_free = true;
  settings.noise.rate_hz = 2000;
  const Stamp zero{1'000'000'000};
  const SimulatedImu imu = simulateImu(trajectory, settings, zero, 5.0);
  REQUIRE(imu.samples.size() == 10001);
  const MotionState begin = trajectory.at(0);
  Eigen::Quaterniond q = begin.T_world_body.rotation;
  Eigen::Vector3d p = begin.T_world_body.translation;
  Eigen::Vector3d v = begin.v_world_body;
  for (std::size_t i = 1; i < imu.samples.size(); ++i) {
    const double dt = (imu.samples[i].stamp - imu.samples[i - 1].stamp).seconds();
    const Eigen::Vector3d rate = 0.5 * (imu.samples[i].gyro + imu.samples[i - 1].gyro);
    const Eigen::Vector3d force = 0.5 * (imu.samples[i].accel + imu.samples[i - 1].accel);
    const Eigen::Vector3d a = q * expSo3(0.5 * dt * rate) * force - Eigen::Vector3d(0, 0, 9.81);
    p += dt * v + 0.5 * dt * dt * a;
    v += dt * a;
    q = q * expSo3(dt * rate);
  }
  const MotionState end = trajectory.at(5.0);
  CHECK((p - end.T_world_body.translation).norm() < 1e-4);
  CHECK((v - end.v_world_body).norm() < 1e-4);
  CHECK(logSo3(q.conjugate() * end.T_world_body.rotation).norm() < 1e-5);
}

TEST_CASE("noise and walk have the model's strength") {
  const SplineTrajectory trajectory = testFlight(60, 60);
  ImuSimulationSettings settings;
  settings.draw_bias = false;
  settings.bias_gyro = {0.01, -0.02, 0.03};
  settings.noise.accel_walk = 0;
  settings.noise.gyro_walk = 0;
  const SimulatedImu imu = simulateImu(trajectory, settings, Stamp{0}, 50.0);
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  Eigen::Vector3d square = Eigen::Vector3d::Zero();
  const auto n = static_cast<double>(imu.samples.size());
  for (const ImuSample& sample : imu.samples) mean += sample.gyro / n;
  for (const ImuSample& sample : imu.samples) square += (sample.gyro - mean).cwiseAbs2() / (n - 1);
  const double sigma = settings.noise.gyro_density * std::sqrt(settings.noise.rate_hz);
  for (int axis = 0; axis < 3; ++axis) {
    CHECK(mean[axis] == Approx(settings.bias_gyro[axis]).margin(4 * sigma / std::sqrt(n)));
    CHECK(std::sqrt(square[axis]) == Approx(sigma).epsilon(0.03));
  }

  // Steps of the walk over one second, over many seeds.
  settings.noise.gyro_walk = 2e-3;
  double sum = 0;
  int count = 0;
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    settings.seed = seed;
    const SimulatedImu run = simulateImu(trajectory, settings, Stamp{0}, 2.0);
    const Eigen::Vector3d walked = run.bias_gyro[300] - run.bias_gyro[100];
    sum += walked.squaredNorm();
    count += 3;
  }
  CHECK(std::sqrt(sum / count) == Approx(settings.noise.gyro_walk).epsilon(0.2));
}

TEST_CASE("vibration, gaps and saturation") {
  const SplineTrajectory trajectory = testFlight(20, 20);
  ImuSimulationSettings settings;
  settings.vibration.accel_amplitude = 2.0;
  settings.noise.rate_hz = 400;
  settings.draw_bias = false;
  settings.gaps = {{5, 6}};
  settings.saturations = {{8, 9}};
  settings.low_accel_limit = 9.0;
  const SimulatedImu imu = simulateImu(trajectory, settings, Stamp{0}, 15.0);
  CHECK(imu.samples.size() == 15 * 400 + 1 - 400);
  double power = 0;
  double count = 0;
  for (const ImuSample& sample : imu.samples) {
    const double t = (sample.stamp - Stamp{0}).seconds();
    CHECK_FALSE((t >= 5.0001 && t < 5.999));
    if (t >= 8 && t < 9) CHECK(sample.accel.cwiseAbs().maxCoeff() <= 9.0);
    if (t < 5) {
      power += sample.accel.y() * sample.accel.y();
      count += 1;
    }
  }
  // A sine of amplitude 2 has RMS sqrt(2).
  CHECK(std::sqrt(power / count) == Approx(std::sqrt(2.0)).epsilon(0.15));
}

TEST_CASE("the estimator's preintegration agrees with the truth at 200 Hz") {
  const SplineTrajectory trajectory = testFlight(10);
  ImuSimulationSettings settings;
  settings.noise_free = true;
  const SimulatedImu imu = simulateImu(trajectory, settings, Stamp{0}, 3.0);
  Preintegration preintegration(settings.noise, Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero());
  REQUIRE(preintegration.integrate(imu.samples, Stamp{0}, Stamp{1'000'000'000}).ok());
  const MotionState i = trajectory.at(0);
  const MotionState j = trajectory.at(1);
  const Eigen::Quaterniond q = i.T_world_body.rotation.conjugate() * j.T_world_body.rotation;
  CHECK(logSo3(preintegration.deltaRotation().conjugate() * q).norm() < 1e-4);
  const Eigen::Vector3d g(0, 0, -9.81);
  const Eigen::Vector3d dp =
      i.T_world_body.rotation.conjugate() *
      (j.T_world_body.translation - i.T_world_body.translation - i.v_world_body - 0.5 * g);
  CHECK((preintegration.deltaPosition() - dp).norm() < 1e-3);
}

}  // namespace
}  // namespace swiftlet
