// The turn of a rolling shutter's rows from gyro samples.

#include "estimator/imu/scan_turn.hpp"

#include <catch2/catch.hpp>
#include <vector>

using namespace swiftlet;

TEST_CASE("Rows turn at the gyro's mean rate before and after the middle") {
  const Eigen::Vector3d rate(0.5, -1, 2), acceleration(10, -20, 5), bias(0.01, 0.02, -0.03);
  const Stamp middle{1'000'000'000};
  const Duration readout = Duration::fromMilliseconds(20);
  std::vector<ImuSample> samples;
  for (int k = -12; k <= 12; ++k) {
    const double t = 2.5e-3 * k;
    samples.push_back(
        {middle + Duration::fromSeconds(t), rate + t * acceleration + bias, Eigen::Vector3d::Zero()});
  }
  const Eigen::Vector3d before = rate - 5e-3 * acceleration;
  const Eigen::Vector3d after = rate + 5e-3 * acceleration;
  const ScanTurn turn = scanTurn(samples, middle, readout, bias, {});
  CHECK((turn.before - before).norm() < 1e-9);
  CHECK((turn.after - after).norm() < 1e-9);
  CHECK((turn.mean() - rate).norm() < 1e-9);
  // Samples that end at the stamp: as it went on.
  const ScanTurn cut = scanTurn(std::span(samples).first(13), middle, readout, bias, {});
  CHECK((cut.before - before).norm() < 1e-9);
  CHECK((cut.after - after).norm() < 1e-9);
  CHECK(scanTurn({}, middle, readout, bias, {}).before.isZero());
  CHECK(scanTurn(samples, middle, {}, bias, {}).before.isZero());
}
