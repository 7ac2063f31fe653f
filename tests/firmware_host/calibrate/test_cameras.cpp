// Lenses and their transform from simulated corners, beside the truth.
#include <catch2/catch.hpp>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "estimator/geometry/so3.hpp"
#include "firmware_host/lab/calibrate/cameras/calibrate_cameras.hpp"
#include "firmware_host/lab/calibrate/cameras/projection_error.hpp"
#include "tests/firmware_host/calibrate/session_input.hpp"
#include "tests/support/long_run.hpp"

using namespace swiftlet;

namespace {

constexpr double kDegree = M_PI / 180;

Eigen::Matrix<double, 8, 1> parameters(const CameraModel& lens) {
  Eigen::Matrix<double, 8, 1> p;
  p << lens.intrinsics(), lens.distortion();
  return p;
}

/// Squared error in sigmas, and the largest of single parameters.
struct SquaredErrors {
  double sum = 0;
  int count = 0;
  double largest = 0;

  template <typename Vector, typename Matrix>
  void add(const Vector& error, const Matrix& covariance) {
    sum += error.dot(covariance.ldlt().solve(error));
    count += static_cast<int>(error.size());
    largest = std::max(largest, (error.array().abs() / covariance.diagonal().array().sqrt()).maxCoeff());
  }
};

}  // namespace

TEST_CASE("cameras from simulated corners are right and know how well", "[long]") {
  // The page's figures; seeds not used while the limits were chosen.
  const int rigs = longOr(50, 2);
  SquaredErrors all;
  std::vector<double> worst_pixel;
  int said_bad = 0;
  for (int i = 0; i < rigs; ++i) {
    const std::uint64_t seed = 400 + static_cast<std::uint64_t>(i);
    const CalibrationRig rig = test::globalShutterRig(seed);
    SessionSettings settings;
    settings.seed = seed;
    settings.camera_rate = longOr(20, 5);
    const CameraSolution solution = calibrateCameras(test::sessionInput(rig, {}, settings));
    CAPTURE(seed);
    for (const std::string& reason : solution.reasons) {
      std::printf("  %lu: %s\n", static_cast<unsigned long>(seed), reason.c_str());
    }
    said_bad += solution.reasons.empty() ? 0 : 1;
    REQUIRE(solution.camera[0].model.width() > 0);
    for (std::size_t c = 0; c < 2; ++c) {
      const CameraModel& found = solution.camera[c].model;
      const CameraModel& truth = rig.rig.camera[c];
      INFO(solution.camera[c].why_this_model);
      REQUIRE(found.kind() == truth.kind());
      const Eigen::Matrix<double, 8, 1> error = parameters(found) - parameters(truth);
      all.add(error, solution.camera[c].covariance);
      const double beyond = quantile(projectionDifference(truth, found), 0.95);
      worst_pixel.push_back(beyond);
      std::printf("%lu cam%zu %s f %.0f: df %.3f dc %.3f, projection %.4f px, nees %.2f\n",
                  static_cast<unsigned long>(seed), c,
                  truth.kind() == CameraKind::kEquidistant ? "kb" : "pin", truth.focal(),
                  error.head<2>().cwiseAbs().maxCoeff(), error.segment<2>(2).cwiseAbs().maxCoeff(), beyond,
                  error.dot(solution.camera[c].covariance.ldlt().solve(error)) / 8);
      CHECK(error.head<4>().cwiseAbs().maxCoeff() < 0.3);
      CHECK(beyond < 0.2);
    }
    const SE3 truth = rig.rig.T_cam1_cam0();
    Eigen::Matrix<double, 6, 1> error;
    error << logSo3(solution.T_cam1_cam0.rotation.conjugate() * truth.rotation),
        truth.translation - solution.T_cam1_cam0.translation;
    all.add(error, solution.stereo_covariance);
    const double per_10_cm = rig.rig.baseline() / 0.1;
    std::printf("%lu baseline %.0f mm: %.4f mm, %.4f degrees, nees %.2f, sigma %.4f\n",
                static_cast<unsigned long>(seed), rig.rig.baseline() * 1e3, error.tail<3>().norm() * 1e3,
                error.head<3>().norm() / kDegree,
                error.dot(solution.stereo_covariance.ldlt().solve(error)) / 6, solution.corner_sigma);
    CHECK(error.tail<3>().norm() * 1e3 < 0.1 * std::max(1.0, per_10_cm));
    CHECK(error.head<3>().norm() / kDegree < 0.01 * std::max(1.0, per_10_cm));
    CHECK(std::abs(solution.corner_sigma - 0.1) < 0.003);
  }
  std::printf("nees %.3f of %d, largest %.2f sigma, bad %d\n", all.sum / all.count, all.count, all.largest,
              said_bad);
  // Two rigs are 44 parameters: their mean square is in this range but once in a thousand times.
  CHECK(all.sum / all.count > longOr(0.7, 0.4));
  CHECK(all.sum / all.count < longOr(1.4, 1.9));
  CHECK(all.largest < 5);
  CHECK(said_bad == 0);
}
