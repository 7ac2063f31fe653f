#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <numbers>
#include <opencv2/calib3d.hpp>
#include <vector>

#include "estimator/camera/camera_model.hpp"
#include "estimator/camera/rig.hpp"
#include "estimator/core/random.hpp"
#include "tests/support/numeric_jacobian.hpp"

namespace swiftlet::test {
namespace {

constexpr double kPi = std::numbers::pi;
const Eigen::Vector4d kEurocIntrinsics(458.654, 457.296, 367.215, 248.375);
const Eigen::Vector4d kEurocRadtan(-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05);
const Eigen::Vector4d kEquidistant(-0.01, 0.005, -0.002, 0.0003);

CameraModel euroc() { return {CameraKind::kPinholeRadtan, 752, 480, kEurocIntrinsics, kEurocRadtan}; }
CameraModel equidistant() { return {CameraKind::kEquidistant, 752, 480, kEurocIntrinsics, kEquidistant}; }
/// 180 degrees across 800 pixels.
CameraModel wide() {
  const double focal = 400.0 / (kPi / 2);
  return {
      CameraKind::kEquidistant, 801, 801, {focal, 1.01 * focal, 400, 401}, {0.02, -0.006, 0.001, -0.0001}};
}
std::vector<CameraModel> allCameras() { return {euroc(), equidistant(), wide()}; }

Eigen::Vector3d ray(double theta, double azimuth) {
  return {std::sin(theta) * std::cos(azimuth), std::sin(theta) * std::sin(azimuth), std::cos(theta)};
}

cv::Matx33d cameraMatrix(const CameraModel& camera) {
  const Eigen::Vector4d& k = camera.intrinsics();
  return {k[0], 0, k[2], 0, k[1], k[3], 0, 0, 1};
}

cv::Vec4d coefficients(const CameraModel& camera) {
  const Eigen::Vector4d& d = camera.distortion();
  return {d[0], d[1], d[2], d[3]};
}

}  // namespace

TEST_CASE("spot values of Kalibr's models", "[camera]") {
  Eigen::Vector2d pixel;
  REQUIRE(euroc().project({0.3, -0.2, 1.0}, pixel));
  CHECK(pixel.x() == Approx(499.90557).margin(6e-6));
  CHECK(pixel.y() == Approx(160.18874).margin(6e-6));
  REQUIRE(equidistant().project({0.6, -0.4, 2.0}, pixel));
  CHECK(pixel.x() == Approx(499.12542).margin(6e-6));
  CHECK(pixel.y() == Approx(160.69510).margin(6e-6));
}

TEST_CASE("projection agrees with OpenCV", "[camera]") {
  Random random(1);
  for (const CameraModel& camera : allCameras()) {
    const bool pinhole = camera.kind() == CameraKind::kPinholeRadtan;
    // OpenCV's fisheye model divides by z: 89 degrees at most.
    const double widest = std::min(camera.maxTheta(), pinhole ? 0.9 : 89.0 * kPi / 180);
    std::vector<cv::Point3d> points;
    std::vector<Eigen::Vector2d> ours;
    for (int i = 0; i < 500; ++i) {
      const Eigen::Vector3d p =
          random.uniform(0.1, 50) * ray(random.uniform(0, widest), random.uniform(0, 2 * kPi));
      Eigen::Vector2d pixel;
      REQUIRE(camera.project(p, pixel));
      points.emplace_back(p.x(), p.y(), p.z());
      ours.push_back(pixel);
    }
    std::vector<cv::Point2d> theirs;
    const cv::Vec3d zero(0, 0, 0);
    if (pinhole) {
      cv::projectPoints(points, zero, zero, cameraMatrix(camera), coefficients(camera), theirs);
    } else {
      cv::fisheye::projectPoints(points, theirs, zero, zero, cameraMatrix(camera), coefficients(camera));
    }
    double worst = 0;
    for (std::size_t i = 0; i < ours.size(); ++i) {
      worst = std::max(worst, (ours[i] - Eigen::Vector2d(theirs[i].x, theirs[i].y)).norm());
    }
    CHECK(worst < 1e-8);
  }
}

TEST_CASE("the projection's Jacobian agrees with differences", "[camera]") {
  Random random(2);
  for (const CameraModel& camera : allCameras()) {
    for (int i = 0; i < 500; ++i) {
      // The axis, its neighbourhood where the formula switches, and the edge of the lens.
      const double edge = camera.maxTheta() - 0.01;
      const double theta = i < 5    ? 0.0
                           : i < 40 ? std::pow(10.0, random.uniform(-12, -2))
                                    : random.uniform(0, std::min(edge, 2.5));
      const Eigen::Vector3d p = random.uniform(0.5, 20) * ray(theta, random.uniform(0, 2 * kPi));
      Eigen::Vector2d pixel;
      Matrix23d jacobian;
      if (!camera.project(p, pixel, &jacobian)) continue;
      const auto project = [&](const Eigen::Vector3d& x) {
        Eigen::Vector2d at = Eigen::Vector2d::Zero();
        (void)camera.project(x, at);
        return at;
      };
      const Eigen::Matrix<double, 2, 3> numeric = numericJacobian<2, 3>(project, p);
      INFO("theta " << theta << " p " << p.transpose());
      CHECK(relativeDifference(jacobian, numeric) < 1e-6);
    }
  }
}

TEST_CASE("every pixel comes back, over the whole image", "[camera]") {
  for (const CameraModel& camera : allCameras()) {
    double worst = 0;
    int inverted = 0;
    int missed = 0;
    for (int y = 0; y < camera.height(); y += 5) {
      for (int x = 0; x < camera.width(); x += 5) {
        const Eigen::Vector2d pixel(x + 0.25, y + 0.75);
        // Only the round part of the wide image holds an image.
        if (camera.width() == 801 && (pixel - Eigen::Vector2d(400, 401)).norm() > 400) continue;
        Eigen::Vector3d bearing;
        Eigen::Vector2d back;
        if (!camera.unproject(pixel, bearing) || !camera.project(bearing, back)) {
          ++missed;
          continue;
        }
        ++inverted;
        CHECK(std::abs(bearing.norm() - 1) < 1e-12);
        worst = std::max(worst, (back - pixel).norm());
      }
    }
    CHECK(missed == 0);
    CHECK(inverted > 10000);
    CHECK(worst < 1e-8);
  }
}

TEST_CASE("a wide lens sees at and beyond 90 degrees", "[camera]") {
  const double focal = 400.0 / (100 * kPi / 180);
  const CameraModel camera(CameraKind::kEquidistant, 801, 801, {focal, focal, 400, 400},
                           Eigen::Vector4d::Zero());
  for (const double degrees : {0.0, 1e-7, 45.0, 89.999, 90.0, 90.001, 99.0, 150.0}) {
    for (int k = 0; k < 12; ++k) {
      const double theta = degrees * kPi / 180;
      const Eigen::Vector3d bearing = ray(theta, k * kPi / 6 + 0.1);
      Eigen::Vector2d pixel;
      REQUIRE(camera.project(3 * bearing, pixel));
      CHECK((pixel - Eigen::Vector2d(400, 400)).norm() == Approx(focal * theta).margin(1e-9));
      Eigen::Vector3d back;
      REQUIRE(camera.unproject(pixel, back));
      CHECK((back - bearing).norm() < 1e-10);
    }
  }
}

TEST_CASE("points behind a pinhole, past the fold and NaN are refused", "[camera]") {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  for (const CameraModel& camera : allCameras()) {
    Eigen::Vector2d pixel;
    Eigen::Vector3d bearing;
    CHECK_FALSE(camera.project({kNan, 0, 1}, pixel));
    CHECK_FALSE(camera.project({0, 0, kNan}, pixel));
    CHECK_FALSE(camera.project({0, 0, 0}, pixel));
    CHECK_FALSE(camera.project({0, 0, -1}, pixel));
    CHECK_FALSE(camera.unproject({kNan, 3}, bearing));
    CHECK_FALSE(camera.unproject({std::numeric_limits<double>::infinity(), 3}, bearing));
  }
  Eigen::Vector2d pixel;
  CHECK_FALSE(euroc().project({0.1, 0.1, -1}, pixel));
  CHECK_FALSE(euroc().project({1, 0, 0}, pixel));
}

TEST_CASE("a folding radial-tangential lens is cut at the fold", "[camera]") {
  // Slope 1 + 3 k1 r^2 = 0 at r = 1.0541 for k1 = -0.3, k2 = 0.
  const CameraModel camera(CameraKind::kPinholeRadtan, 752, 480, kEurocIntrinsics, {-0.3, 0, 0, 0});
  const double fold = std::sqrt(1 / 0.9);
  CHECK(std::tan(camera.maxTheta()) == Approx(fold).epsilon(0.005));
  CHECK(std::tan(camera.maxTheta()) < fold);
  Eigen::Vector2d pixel;
  CHECK(camera.project({1.04, 0, 1}, pixel));
  CHECK_FALSE(camera.project({1.06, 0, 1}, pixel));
  CHECK_FALSE(camera.project({1.6, 0, 1}, pixel));  // would reappear inside the image
  // The largest image radius is 0.7027 (at the fold): a pixel beyond it has no inverse.
  Eigen::Vector3d bearing;
  CHECK_FALSE(
      camera.unproject({kEurocIntrinsics[2] + 0.71 * kEurocIntrinsics[0], kEurocIntrinsics[3]}, bearing));
  REQUIRE(camera.unproject({kEurocIntrinsics[2] + 0.69 * kEurocIntrinsics[0], kEurocIntrinsics[3]}, bearing));
  CHECK(bearing.x() / bearing.z() < fold);
  // Just inside the fold the inverse is the branch on this side of it.
  for (double r = 0.01; r < 1.03; r += 0.01) {
    REQUIRE(camera.project({r, 0, 1}, pixel));
    REQUIRE(camera.unproject(pixel, bearing));
    CHECK(bearing.x() / bearing.z() == Approx(r).epsilon(1e-7));
  }
  // EuRoC's own lens does not fold.
  CHECK(euroc().maxTheta() > 1.4);
}

TEST_CASE("a folding equidistant lens is cut at the fold", "[camera]") {
  // Slope 1 - 0.3 theta^2 = 0 at theta = 1.8257 for k1 = -0.1.
  const CameraModel camera(CameraKind::kEquidistant, 752, 480, kEurocIntrinsics, {-0.1, 0, 0, 0});
  CHECK(camera.maxTheta() == Approx(std::sqrt(1 / 0.3)).margin(0.002));
  Eigen::Vector2d pixel;
  CHECK(camera.project(ray(1.8, 0.3), pixel));
  CHECK_FALSE(camera.project(ray(1.84, 0.3), pixel));
  Eigen::Vector3d bearing;
  const double largest = 1.8257 * (1 - 0.1 * 1.8257 * 1.8257);  // image radius at the fold
  CHECK_FALSE(
      camera.unproject({kEurocIntrinsics[2] + 1.01 * largest * kEurocIntrinsics[0], 248.375}, bearing));
  for (double theta = 0.01; theta < 1.8; theta += 0.01) {
    REQUIRE(camera.project(ray(theta, 0), pixel));
    REQUIRE(camera.unproject(pixel, bearing));
    CHECK(std::atan2(bearing.x(), bearing.z()) == Approx(theta).epsilon(1e-7));
  }
}

TEST_CASE("image borders and the rig", "[camera]") {
  const CameraModel camera = euroc();
  CHECK(camera.inImage({0, 0}));
  CHECK(camera.inImage({751, 479}));
  CHECK_FALSE(camera.inImage({751.1, 479}));
  CHECK_FALSE(camera.inImage({4, 100}, 5));
  CHECK(camera.focal() == Approx(457.975));

  Rig rig;
  rig.camera_count = 2;
  rig.T_body_cam[0] = SE3(expSo3({0.1, 0.2, 0.3}), Eigen::Vector3d(1, 2, 3));
  rig.T_body_cam[1] = rig.T_body_cam[0] * SE3(Eigen::Quaterniond::Identity(), Eigen::Vector3d(0.11, 0, 0));
  // A point straight ahead of cam0 lies to the left in cam1.
  CHECK((rig.T_cam1_cam0() * Eigen::Vector3d(0, 0, 5) - Eigen::Vector3d(-0.11, 0, 5)).norm() < 1e-14);
  CHECK(rig.baseline() == Approx(0.11));
}

}  // namespace swiftlet::test
