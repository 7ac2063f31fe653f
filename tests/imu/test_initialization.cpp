// Starts: tilt on simulated data with exact truth.

#include "estimator/imu/initialization.hpp"

#include <catch2/catch.hpp>
#include <cmath>
#include <cstdio>
#include <vector>

#include "estimator/geometry/so3.hpp"
#include "tests/imu/analytic_trajectory.hpp"

using namespace swiftlet;
using namespace swiftlet::test;

namespace {

double angle(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

}  // namespace

TEST_CASE("The gravity-aligned rotation takes up to z and turns least") {
  Random random(1);
  for (int i = 0; i < 100; ++i) {
    const Eigen::Vector3d up = normalVector(random).normalized();
    const Eigen::Quaterniond q = gravityAlignedRotation(up);
    CHECK((q * up - Eigen::Vector3d::UnitZ()).norm() < 1e-9);
    CHECK(logSo3(q).norm() == Approx(angle(up, Eigen::Vector3d::UnitZ())).margin(1e-7));
  }
  CHECK((gravityAlignedRotation(-Eigen::Vector3d::UnitZ()) * -Eigen::Vector3d::UnitZ()).z() == Approx(1.0));
}

TEST_CASE("Tilt: refused without samples and in free fall") {
  const ImuNoise noise;
  TiltEstimate tilt;
  CHECK(estimateTilt({}, stampOf(1), noise, {}, tilt).code == StatusCode::kInvalidInput);
  const std::vector<ImuSample> falling{{stampOf(0.9), Eigen::Vector3d::Zero(), Eigen::Vector3d(0, 0, 0.5)}};
  CHECK(estimateTilt(falling, stampOf(1), noise, {}, tilt).code == StatusCode::kDegenerate);
}

TEST_CASE("Tilt: a vehicle that manoeuvres is told from one that stands by its sigma", "[figures]") {
  const ImuNoise noise;
  Random random(12);
  double stands = 0;
  for (const double acceleration : {0.0, 1.8}) {  // m/s^2 per level axis, anew every 0.3 s
    double errors = 0, sigmas = 0;
    constexpr int kStarts = 400;
    for (int start = 0; start < kStarts; ++start) {
      std::vector<ImuSample> samples;
      Eigen::Vector3d moving = Eigen::Vector3d::Zero();
      for (int i = 0; i < 180; ++i) {
        if (i % 60 == 0) moving = acceleration * Eigen::Vector3d(random.normal(), random.normal(), 0);
        samples.push_back({stampOf(1 - 0.005 * (180 - i)), Eigen::Vector3d::Zero(),
                           moving + Eigen::Vector3d(0, 0, noise.gravity)});
      }
      TiltEstimate tilt;
      REQUIRE(estimateTilt(samples, stampOf(1), noise, {}, tilt).ok());
      errors += std::pow(angle(tilt.up, Eigen::Vector3d::UnitZ()), 2) / 2;
      sigmas += tilt.sigma * tilt.sigma;
    }
    const double error = std::sqrt(errors / kStarts), sigma = std::sqrt(sigmas / kStarts);
    std::printf("tilt, accelerations of %.1f m/s^2: error %.4f rad per axis, sigma %.4f\n", acceleration,
                error, sigma);
    CHECK(error < 2 * sigma);
    if (acceleration == 0) stands = sigma;
    if (acceleration > 0) CHECK(sigma > 1.5 * stands);
  }
}
