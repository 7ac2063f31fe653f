// The page of a calibration: uncertainty and differences of lenses beside sampling, rules and words, and what
// the file holds.

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <string>
#include <vector>

#include "estimator/core/random.hpp"
#include "estimator/geometry/so3.hpp"
#include "firmware_host/lab/calibrate/cameras/projection_error.hpp"
#include "firmware_host/lab/calibrate/page/solution_pages.hpp"

namespace swiftlet {
namespace {

using Vector8d = Eigen::Matrix<double, 8, 1>;

CameraModel lens(const Vector8d& off = Vector8d::Zero()) {
  const Eigen::Vector4d intrinsics(458.6, 457.3, 367.2, 248.4);
  const Eigen::Vector4d distortion(-0.283, 0.074, 2e-4, 2e-5);
  return {CameraKind::kPinholeRadtan, 752, 480, intrinsics + off.head<4>(), distortion + off.tail<4>()};
}

Vector8d lensSigmas() {
  Vector8d sigma;
  sigma << 0.3, 0.3, 0.4, 0.4, 8e-4, 8e-4, 1e-4, 1e-4;
  return sigma;
}

std::vector<Eigen::Vector2d> somePixels() {
  std::vector<Eigen::Vector2d> pixels;
  for (double u = 40; u < 752; u += 96) {
    for (double v = 30; v < 480; v += 84) pixels.emplace_back(u, v);
  }
  return pixels;
}

TEST_CASE("Uncertainty of a pixel is that of sampled lenses after the best rotation") {
  // Small: the fit of the rotation weighs differences of a pixel down.
  const Vector8d sigma = 0.2 * lensSigmas();
  const std::vector<Eigen::Vector2d> pixels = somePixels();
  const std::vector<double> told =
      worstSigmas(lens(), sigma.cwiseAbs2().asDiagonal().toDenseMatrix(), pixels);
  std::vector<Eigen::Matrix2d> sums(pixels.size(), Eigen::Matrix2d::Zero());
  Random random(17);
  constexpr int kSamples = 500;
  for (int sample = 0; sample < kSamples; ++sample) {
    Vector8d off;
    for (int i = 0; i < 8; ++i) off[i] = sigma[i] * random.normal();
    const auto difference =
        projectionDifference(lens(), lens(off), pixels, std::vector<bool>(pixels.size(), true));
    for (std::size_t k = 0; k < pixels.size(); ++k)
      sums[k] += difference[k] * difference[k].transpose() / kSamples;
  }
  for (std::size_t k = 0; k < pixels.size(); ++k) {
    const double sampled =
        std::sqrt(Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(sums[k]).eigenvalues()[1]);
    INFO(pixels[k].transpose());
    CHECK(told[k] == Approx(sampled).epsilon(0.15));
  }
  // Without the rotation the centre alone makes 0.08 px in the middle of the image.
  CHECK(told[pixels.size() / 2] < 0.05);
}

TEST_CASE("Where the distortion of a pinhole folds inside the image, its lens is unknown") {
  const Vector8d sigma = lensSigmas();
  const Eigen::Matrix<double, 8, 8> covariance = sigma.cwiseAbs2().asDiagonal().toDenseMatrix();
  const auto folded = [](CameraKind kind) {
    return CameraModel(kind, 752, 480, {300, 300, 376, 240}, {-0.5, 0, 0, 0});
  };
  const CameraModel pinhole = folded(CameraKind::kPinholeRadtan);
  CHECK(rayShare(pinhole) == Approx(0.23).margin(0.03));
  CHECK(std::isinf(quantile(projectionSigmas(pinhole, covariance), 0.95)));
  CHECK(std::isfinite(rms(projectionSigmas(pinhole, covariance))));
  // The corners of a fisheye's image are dark.
  const CameraModel fisheye = folded(CameraKind::kEquidistant);
  CHECK(rayShare(fisheye) < 0.5);
  CHECK(std::isfinite(quantile(projectionSigmas(fisheye, covariance), 0.95)));
}

TEST_CASE("A turned camera is no difference between lenses, a longer focal length is") {
  const std::vector<Eigen::Vector2d> pixels = somePixels();
  const std::vector<bool> all(pixels.size(), true);
  for (const auto& difference : projectionDifference(lens(), lens(), pixels, all))
    CHECK(difference.norm() < 1e-6);
  Vector8d longer = Vector8d::Zero();
  longer[0] = 4.586;
  longer[1] = 4.573;
  const auto difference = projectionDifference(lens(), lens(longer), pixels, all);
  for (std::size_t k = 0; k < pixels.size(); ++k) {
    const Eigen::Vector2d expected = 0.01 * (pixels[k] - Eigen::Vector2d(367.2, 248.4));
    CHECK((difference[k] - expected).norm() < 0.25);
  }
}

/// Views of a board by a rig that knows itself: what a good calibration leaves.
CameraSolution goodSolution(std::uint64_t seed) {
  CameraSolution solution;
  Random random(seed);
  solution.camera_count = 2;
  solution.corner_sigma = 0.12;
  solution.T_cam1_cam0 = SE3(Eigen::Quaterniond::Identity(), Eigen::Vector3d(-0.11, 0, 0));
  solution.stereo_covariance.diagonal() << 1e-10, 1e-10, 1e-10, 1e-10, 1e-10, 1e-10;
  for (std::size_t c = 0; c < 2; ++c) {
    SolvedCamera& camera = solution.camera[c];
    camera.model = lens();
    camera.covariance.diagonal() = (0.1 * lensSigmas()).cwiseAbs2();
    camera.why_this_model = "radial-tangential fits to 0.12 px, equidistant to 0.31 px";
    camera.rms = solution.corner_sigma;
    for (CameraModel& half : camera.halves) {
      Vector8d off;
      for (int i = 0; i < 8; ++i) off[i] = 0.14 * lensSigmas()[i] * random.normal();
      half = lens(off);
    }
  }
  const CalibrationTarget target;
  for (std::size_t view = 0; view < 60; ++view) {
    SolvedView solved;
    solved.stamp = Stamp{static_cast<std::int64_t>(view) * 500'000'000};
    const Eigen::Vector3d tilt(random.uniform(-0.5, 0.5), random.uniform(-0.5, 0.5),
                               random.uniform(-0.5, 0.5));
    // The board's y is up, the camera's is down; its centre somewhere in the image.
    const Eigen::Quaterniond R = expSo3(tilt) * Eigen::Quaterniond(Eigen::Vector4d(1, 0, 0, 0));
    const Eigen::Vector3d middle(random.uniform(-0.5, 0.5), random.uniform(-0.35, 0.35),
                                 random.uniform(0.7, 1.2));
    solved.T_cam0_board = SE3(R, middle - R * Eigen::Vector3d(0.33, 0.33, 0));
    for (std::size_t c = 0; c < 2; ++c) {
      const SE3 T_cam_board = c == 0 ? solved.T_cam0_board : solution.T_cam1_cam0 * solved.T_cam0_board;
      for (int id = 0; id < target.cornerCount(); ++id) {
        CornerResidual corner;
        corner.camera = c;
        corner.view = view;
        corner.corner = id;
        const bool seen = lens().project(T_cam_board * target.corner(id), corner.pixel);
        if (!seen || !lens().inImage(corner.pixel)) continue;
        corner.residual = solution.corner_sigma * Eigen::Vector2d(random.normal(), random.normal());
        corner.outlier = random.below(200) == 0;
        if (corner.outlier) corner.residual *= 20;
        solution.corners.push_back(corner);
      }
    }
    solution.views.push_back(solved);
  }
  return solution;
}

bool says(const CalibrationPage& page, const std::string& text) {
  for (const std::string& line : page.words) {
    if (line.find(text) != std::string::npos) return true;
  }
  return false;
}

const Plot* plotOf(const CalibrationPage& page, const std::string& id) {
  for (const Plot& plot : page.plots) {
    if (plot.id == id) return &plot;
  }
  return nullptr;
}

TEST_CASE("A good calibration of cameras is called good, and each fault is named") {
  const CameraSolution good = goodSolution(1);
  const CalibrationPage page = cameraPage(good, {}, "board_log");
  for (const std::string& line : page.words) UNSCOPED_INFO(line);
  CHECK(page.verdict == PageVerdict::kGood);
  for (const char* id :
       {"vectors0", "vectors1", "scatter0", "coverage1", "uncertainty0", "halves1", "views"}) {
    INFO(id);
    REQUIRE(plotOf(page, id) != nullptr);
    CHECK_FALSE(plotOf(page, id)->empty());
  }
  CHECK(page.scene["surfaces"].size() == 2);

  CameraSolution refused = good;
  refused.reasons = {"Too few views: 4 of 10. Record more."};
  CHECK(cameraPage(refused, {}, "").verdict == PageVerdict::kRepeat);
  CHECK(says(cameraPage(refused, {}, ""), "Too few views"));
  refused.camera[0].model = {};  // not even a lens
  CHECK(cameraPage(refused, {}, "").verdict == PageVerdict::kRepeat);
  CHECK(says(cameraPage(refused, {}, ""), "Too few views"));

  CameraSolution one_sided = good;
  std::erase_if(one_sided.corners,
                [](const CornerResidual& c) { return c.camera == 0 && c.pixel.x() > 350; });
  CHECK(cameraPage(one_sided, {}, "").verdict == PageVerdict::kUsable);
  CHECK(says(cameraPage(one_sided, {}, ""), "Camera 0 saw the board only in"));
  CHECK(says(cameraPage(one_sided, {}, ""), "right"));

  CameraSolution bent = good;
  Vector8d off = Vector8d::Zero();
  off[4] = 0.02;
  bent.camera[1].halves[0] = lens(off);
  CHECK(says(cameraPage(bent, {}, ""), "halves of camera 1 differ by more than noise"));

  CameraSolution unsure = good;
  unsure.camera[0].covariance *= 400;
  CHECK(says(cameraPage(unsure, {}, ""), "lens of camera 0 is not determined well enough"));

  CameraSolution skewed = good;
  for (CornerResidual& corner : skewed.corners) {
    if (corner.camera == 1 && corner.pixel.x() > 600) corner.residual.x() += 0.2;
  }
  CHECK(says(cameraPage(skewed, {}, ""), "Residuals of camera 1 have a systematic direction"));
}

TEST_CASE("Halves that differ by their uncertainty differ by once what is expected") {
  CameraSolution solution = goodSolution(1);
  Random random(3);
  double squares = 0;
  constexpr int kDraws = 60;
  for (int draw = 0; draw < kDraws; ++draw) {
    // Each half has twice the covariance of the whole; small, as the fit of the rotation weighs down.
    for (CameraModel& half : solution.camera[0].halves) {
      Vector8d off;
      for (int i = 0; i < 8; ++i) off[i] = std::sqrt(2) * 0.1 * lensSigmas()[i] * random.normal();
      half = lens(off);
    }
    const CalibrationPage page = cameraPage(solution, {}, "");
    const auto rules = std::ranges::find(page.tables, "rules", &Table::id);
    REQUIRE(rules != page.tables.end());
    const auto row = std::ranges::find_if(rules->rows, [](const std::vector<std::string>& cells) {
      return cells.front() == "camera 0: difference of the halves over twice the uncertainty";
    });
    REQUIRE(row != rules->rows.end());
    squares += std::pow(std::stod(row->at(1)), 2) / kDraws;
  }
  CHECK(std::sqrt(squares) == Approx(1).epsilon(0.1));
}

TEST_CASE("The page of cameras and IMU judges residuals and sigmas") {
  const CameraSolution cameras = goodSolution(2);
  ImuCameraSolution solution;
  solution.rig.camera_count = 2;
  solution.rig.camera = {cameras.camera[0].model, cameras.camera[1].model};
  solution.rig.T_body_cam[1] = cameras.T_cam1_cam0.inverse();
  solution.corner_sigma = cameras.corner_sigma;
  solution.views = cameras.views;
  solution.corners = cameras.corners;
  solution.gyro_sigma = 1.05;
  solution.accel_sigma = 0.96;
  solution.values = {{"T_body_cam0 rotation x", "deg", 0.4, 0.01},
                     {"T_body_cam0 position x", "mm", -21, 0.8},
                     {"time offset", "ms", 1.2, 0.02}};
  Random random(3);
  for (int i = 0; i < 2000; ++i) {
    ImuResidual residual;
    residual.stamp = Stamp{static_cast<std::int64_t>(i) * 5'000'000};
    for (int axis = 0; axis < 3; ++axis) {
      residual.gyro[axis] = 0.003 * random.normal();
      residual.accel[axis] = 0.03 * random.normal();
    }
    solution.imu_residuals.push_back(residual);
  }
  const CalibrationPage page = imuCameraPage(solution, {}, "board_log");
  for (const std::string& line : page.words) UNSCOPED_INFO(line);
  CHECK(page.verdict == PageVerdict::kGood);
  REQUIRE(plotOf(page, "gyro_residual") != nullptr);
  CHECK(plotOf(page, "gyro_residual")->series.size() == 3);

  solution.gyro_sigma = 4;
  solution.values[0].sigma = 0.2;
  const CalibrationPage worse = imuCameraPage(solution, {}, "board_log");
  CHECK(worse.verdict == PageVerdict::kUsable);
  CHECK(says(worse, "The gyro fits the motion worse"));
  CHECK(says(worse, "rotation from the cameras to the IMU"));
}

TEST_CASE("The file needs nothing else, with the page's program and plain") {
  const CalibrationPage page = cameraPage(goodSolution(4), {}, "a <b>log</b>");
  const std::string plain = calibrationHtml(page, "", "");
  CHECK(plain.find("Good: all rules are met.") != std::string::npos);
  CHECK(plain.find("<svg") != std::string::npos);
  CHECK(plain.find("<b>log") == std::string::npos);
  CHECK(plain.find("src=") == std::string::npos);
  CHECK(plain.size() < 6'000'000);
  const std::string whole = calibrationHtml(page, "<html><!--swiftlet-report-document--></html>", "program");
  CHECK(whole.find(R"("kind":"good")") != std::string::npos);
  CHECK(whole.find(R"("kind":"drawing")") != std::string::npos);
  // Same input, same bytes.
  CHECK(calibrationHtml(cameraPage(goodSolution(4), {}, "a <b>log</b>"), "", "") == plain);
}

}  // namespace
}  // namespace swiftlet
