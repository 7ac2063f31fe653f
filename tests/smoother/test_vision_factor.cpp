// Sightings: Jacobians against numeric differentiation, the residual's meaning in pixels,
// triangulation.

#include "estimator/smoother/vision_factor.hpp"

#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>
#include <vector>

#include "estimator/core/random.hpp"
#include "estimator/geometry/so3.hpp"
#include "tests/smoother/window_scene.hpp"
#include "tests/support/numeric_jacobian.hpp"

using namespace swiftlet;
using test::boxPlus;
using test::kPixelSigma;
using test::numericJacobian;
using test::randomVector;
using test::relativeDifference;
using test::sightingOf;

namespace {

constexpr double kSightingTolerance = 1e-7;

LandmarkPoint pointAt(const Eigen::Vector3d& reference, const Eigen::Vector3d& position) {
  LandmarkPoint point;
  point.triangulated = true;
  point.reference = reference;
  point.bearing = (position - reference).normalized();
  point.inverse_depth = 1.0 / (position - reference).norm();
  return point;
}

LandmarkPoint movedPoint(LandmarkPoint point, const PointBasis& basis, const Eigen::Vector3d& d) {
  point.bearing += d[0] * basis.b1 + d[1] * basis.b2;  // the ray's length is free: residuals are homogeneous
  point.inverse_depth += d[2];
  return point;
}

struct Case {
  SE3 T_world_body;
  SE3 T_body_cam;
  CameraSighting sighting;
  LandmarkPoint point;
  RowMotion rows{};
};

CameraPose placed(const Case& c, const SE3& T_world_body, const SE3& T_body_cam) {
  CameraPose camera = CameraPose::of(T_world_body, T_body_cam);
  camera.rows = c.rows;
  return camera;
}

// A camera anywhere, a point `angle` off its optical axis, measured with an error of some sigmas.
Case randomCase(const CameraModel& camera, double angle, Random& random) {
  Case c;
  c.T_world_body = SE3(expSo3(randomVector(random, 1.5)), randomVector(random, 3));
  c.T_body_cam = SE3(expSo3(randomVector(random, 1.5)), randomVector(random, 0.2));
  const double around = random.uniform(0, 2 * std::numbers::pi);
  const Eigen::Vector3d ray(std::sin(angle) * std::cos(around), std::sin(angle) * std::sin(around),
                            std::cos(angle));
  const Eigen::Vector3d measured = expSo3(randomVector(random, 0.005)) * ray;
  REQUIRE(sightingOf(camera, measured, kPixelSigma, c.sighting));
  const Eigen::Vector3d position =
      c.T_world_body * c.T_body_cam * Eigen::Vector3d(random.uniform(0.5, 20) * ray);
  c.point = pointAt((c.T_world_body * c.T_body_cam).translation + randomVector(random, 0.2), position);
  return c;
}

void checkSightingJacobians(const Case& c) {
  const CameraPose camera = placed(c, c.T_world_body, c.T_body_cam);
  const PointBasis basis = PointBasis::of(c.point.bearing);
  SightingJacobians J;
  REQUIRE(reprojectionJacobians(c.sighting, camera, c.T_body_cam, c.point, basis, true, J));
  const auto residual = [&](const SE3& T_world_body, const SE3& T_body_cam, const LandmarkPoint& point) {
    Eigen::Vector2d r;
    REQUIRE(reprojectionResidual(c.sighting, placed(c, T_world_body, T_body_cam), point, r));
    return r;
  };
  const auto of_pose =
      numericJacobian<2, 6>([&](const SE3& T) { return residual(T, c.T_body_cam, c.point); }, c.T_world_body);
  const auto of_extrinsic =
      numericJacobian<2, 6>([&](const SE3& T) { return residual(c.T_world_body, T, c.point); }, c.T_body_cam);
  const auto of_point = numericJacobian<2, 3>(
      [&](const Eigen::Vector3d& d) {
        return residual(c.T_world_body, c.T_body_cam, movedPoint(c.point, basis, d));
      },
      Eigen::Vector3d(Eigen::Vector3d::Zero()));
  CHECK(relativeDifference(J.pose, of_pose) < kSightingTolerance);
  CHECK(relativeDifference(J.extrinsic, of_extrinsic) < kSightingTolerance);
  CHECK(relativeDifference(J.point, of_point) < kSightingTolerance);
}

}  // namespace

TEST_CASE("Reprojection Jacobians: pose, point and extrinsics", "[smoother][vision_factor]") {
  Random random(11);
  const CameraModel pinhole = makeRig(RigKind::kEuroc).rig.camera[0];
  const CameraModel fisheye = test::wideFisheye();
  for (int trial = 0; trial < 60; ++trial) {
    INFO("trial " << trial);
    checkSightingJacobians(randomCase(pinhole, random.uniform(0, 0.6), random));
    checkSightingJacobians(randomCase(fisheye, random.uniform(0, 1.5), random));
    // Beyond 90 degrees, where z is negative.
    checkSightingJacobians(randomCase(fisheye, random.uniform(1.6, 1.9), random));
    Case rolling = randomCase(pinhole, random.uniform(0, 0.6), random);
    rolling.sighting.row = static_cast<float>(random.uniform(-0.5, 0.5));
    rolling.rows = {0.02, randomVector(random, 2), randomVector(random, 1), randomVector(random, 1)};
    checkSightingJacobians(rolling);
  }
}

TEST_CASE("A rolling shutter's residual is that of the camera when the row was read",
          "[smoother][vision_factor]") {
  Random random(15);
  Rig rig = makeRig(RigKind::kEuroc).rig;
  rig.readout = Duration::fromMilliseconds(30);
  double largest = 0;
  double untold = 0;
  for (int trial = 0; trial < 100; ++trial) {
    const SE3 T(expSo3(randomVector(random, 1.5)), randomVector(random, 3));
    const Eigen::Vector3d omega = randomVector(random, 2);
    const Eigen::Vector3d v = randomVector(random, 3);
    RigPose rig_pose;
    rig_pose.v_world = v;
    std::array<bool, kMaxCameras> seen{};
    std::array<Eigen::Vector2f, kMaxCameras> pixel{};
    const Eigen::Vector3d at_middle(random.uniform(-1, 1), random.uniform(-0.7, 0.7), random.uniform(2, 10));
    const Eigen::Vector3d p = T * rig.T_body_cam[0] * at_middle;
    for (std::size_t c = 0; c < kMaxCameras; ++c) {
      rig_pose.place(c, rig.T_body_cam[c], T, rig.readout.seconds(), {omega, omega});
      Eigen::Vector2d at(0, 240);
      for (int round = 0; round < 8; ++round) {
        const double t = rig.rowTime(c, at.y());
        const SE3 then(T.rotation * expSo3(t * omega), T.translation + t * v);
        seen[c] = rig.camera[c].project((then * rig.T_body_cam[c]).inverse() * p, at);
      }
      pixel[c] = at.cast<float>();
    }
    const Sighting sighting = makeSighting(rig, seen, pixel, kPixelSigma, 0);
    const LandmarkPoint point = pointAt(rig_pose.current[0].center, p);
    for (std::size_t c = 0; c < kMaxCameras; ++c) {
      Eigen::Vector2d r;
      if (!sighting.camera[c].used) continue;
      REQUIRE(reprojectionResidual(sighting.camera[c], rig_pose.current[c], point, r));
      largest = std::max(largest, kPixelSigma * r.norm());
      const CameraPose global = CameraPose::of(T, rig.T_body_cam[c]);
      REQUIRE(reprojectionResidual(sighting.camera[c], global, point, r));
      untold = std::max(untold, kPixelSigma * r.norm());
    }
  }
  CHECK(largest < 0.02);  // px: the lever arm turns while the rows are read, which is left out
  CHECK(untold > 10);
}

TEST_CASE("Reprojection Jacobians at a point without depth", "[smoother][vision_factor]") {
  Random random(12);
  const CameraModel pinhole = makeRig(RigKind::kEuroc).rig.camera[0];
  Case c = randomCase(pinhole, 0.3, random);
  const Eigen::Vector3d ray = (c.T_world_body * c.T_body_cam).rotation * c.sighting.ray();
  c.point.bearing = ray;
  c.point.inverse_depth = 0;
  checkSightingJacobians(c);
  SightingJacobians J;
  REQUIRE(reprojectionJacobians(c.sighting, CameraPose::of(c.T_world_body, c.T_body_cam), c.T_body_cam,
                                c.point, PointBasis::of(c.point.bearing), true, J));
  CHECK(J.pose.rightCols<3>().norm() == 0);  // a star does not show where one is
}

TEST_CASE("The residual is the reprojection error in sigmas, to first order", "[smoother][vision_factor]") {
  Random random(13);
  const CameraModel pinhole = makeRig(RigKind::kEuroc).rig.camera[0];
  const CameraModel fisheye = test::wideFisheye();
  for (int trial = 0; trial < 200; ++trial) {
    const bool wide = trial % 2 == 0;
    const CameraModel& camera = wide ? fisheye : pinhole;
    const Case c = randomCase(camera, random.uniform(0, wide ? 1.9 : 0.6), random);
    const CameraPose pose = CameraPose::of(c.T_world_body, c.T_body_cam);
    Eigen::Vector2d r;
    REQUIRE(reprojectionResidual(c.sighting, pose, c.point, r));
    Eigen::Vector2d predicted;
    Eigen::Vector2d measured;
    REQUIRE(camera.project(pose.R_cam_world * (c.point.position() - pose.center), predicted));
    REQUIRE(camera.project(c.sighting.ray(), measured));
    const Eigen::Vector2d expected = (predicted - measured) / kPixelSigma;
    // Errors are some 3 px of a focal length of 250 to 450 px: second order is a few per cent.
    CHECK((r - expected).norm() < 0.05 * expected.norm() + 1e-6);
  }
}

TEST_CASE("The residual refuses a point that is not in front of the measured ray",
          "[smoother][vision_factor]") {
  Random random(14);
  const CameraModel pinhole = makeRig(RigKind::kEuroc).rig.camera[0];
  Case c = randomCase(pinhole, 0.2, random);
  const CameraPose pose = CameraPose::of(c.T_world_body, c.T_body_cam);
  c.point.bearing = -c.point.bearing;
  c.point.reference = pose.center;
  Eigen::Vector2d r;
  SightingJacobians J;
  CHECK_FALSE(reprojectionResidual(c.sighting, pose, c.point, r));
  CHECK_FALSE(reprojectionJacobians(c.sighting, pose, c.T_body_cam, c.point, PointBasis::of(c.point.bearing),
                                    true, J));
}

TEST_CASE("The robust weight falls with the residual, and its cost is the integral of its gradient",
          "[smoother][vision_factor]") {
  double cost = 0;
  constexpr double kStep = 1e-3;
  for (double e = 0; e < 8; e += kStep) {
    const double middle = e + 0.5 * kStep;
    cost += RobustWeight::cauchy(middle * middle).weight * middle * kStep;
    const double end = e + kStep;
    CHECK(RobustWeight::cauchy(end * end).cost == Approx(cost).margin(1e-4));
  }
  const double whole = RobustWeight::cauchy(0.0).weight;
  CHECK(RobustWeight::cauchy(100.0).weight < 0.05 * whole);
  // Of a normal residual (2 dof) the mean weight is the information that the estimate really has,
  // E[psi']^2 / E[psi^2] = 0.916 at a scale of 2 sigmas.
  Random random(14);
  double sum = 0;
  constexpr int kSamples = 200000;
  for (int k = 0; k < kSamples; ++k) {
    const double a = random.normal();
    const double b = random.normal();
    sum += RobustWeight::cauchy(a * a + b * b).weight;
  }
  CHECK(sum / kSamples == Approx(0.916).margin(0.005));
}

TEST_CASE("Triangulation is exact without noise, from nothing", "[smoother][triangulate]") {
  Random random(15);
  const Rig rig = makeRig(RigKind::kEuroc).rig;
  for (int trial = 0; trial < 100; ++trial) {
    INFO("trial " << trial);
    const double depth = std::exp(random.uniform(std::log(0.4), std::log(30.0)));
    const test::WindowScene scene = test::sceneAround(rig, 6, 0.1 * depth, random);
    const Eigen::Vector3d p = scene.inSight(rig, depth, random);
    const std::vector<Sighting> sightings = scene.sightings(rig, p, kPixelSigma, 0, random);
    REQUIRE(sightings.size() >= 2);
    LandmarkPoint point;
    REQUIRE(triangulate(scene.poses, sightings, 10, point));
    CHECK(point.triangulated);
    CHECK(std::abs(point.bearing.norm() - 1) < 1e-12);
    // The weak depth prior (30 / m) pulls by inverse_depth (sigma / 30)^2; a tenth of a sigma is far above.
    CHECK(std::abs(point.inverse_depth * (p - point.reference).norm() - 1) < 1e-4);
    CHECK((point.position() - p).norm() < 1e-4 * depth);
    CHECK(meanSquaredResidual(scene.poses, sightings, point) < 1e-6);
  }
}

TEST_CASE("Triangulation says how well the inverse depth is known", "[smoother][triangulate]") {
  Random random(16);
  const Rig rig = makeRig(RigKind::kEuroc).rig;
  double sum = 0;
  constexpr int kTrials = 600;
  int used = 0;
  for (int trial = 0; trial < kTrials; ++trial) {
    const double depth = random.uniform(1, 6);
    const test::WindowScene scene = test::sceneAround(rig, 5, 0.4, random);
    const Eigen::Vector3d p = scene.inSight(rig, depth, random);
    const std::vector<Sighting> sightings = scene.sightings(rig, p, kPixelSigma, kPixelSigma, random);
    LandmarkPoint point;
    if (sightings.size() < 2 || !triangulate(scene.poses, sightings, 10, point)) continue;
    const double error = point.inverse_depth - 1.0 / (p - point.reference).norm();
    sum += std::pow(error / point.inverse_depth_sigma, 2);
    ++used;
  }
  REQUIRE(used > kTrials * 9 / 10);
  // Mean of chi-square(1) over 540 or more: sigma at most 0.061. The robust weights are scaled so that
  // the reported sigma stays right.
  CHECK(sum / used > 0.8);
  CHECK(sum / used < 1.25);
}

TEST_CASE("Triangulation of a far point: a direction, with an honest sigma", "[smoother][triangulate]") {
  Random random(17);
  const Rig rig = makeRig(RigKind::kEuroc).rig;
  for (int trial = 0; trial < 50; ++trial) {
    INFO("trial " << trial);
    const test::WindowScene scene = test::sceneAround(rig, 5, 0.05, random);
    const Eigen::Vector3d p = scene.inSight(rig, 1e5, random);
    const std::vector<Sighting> sightings = scene.sightings(rig, p, kPixelSigma, 0.1, random);
    LandmarkPoint point;
    REQUIRE(triangulate(scene.poses, sightings, 10, point));
    CHECK(point.bearing.dot((p - point.reference).normalized()) > std::cos(1e-3));
    CHECK(point.inverse_depth >= 0);
    CHECK(point.inverse_depth < 4 * point.inverse_depth_sigma + 1e-6);
    CHECK(point.inverse_depth_sigma > 1e-3);
  }
}

TEST_CASE("Triangulation refuses a point behind, and sightings of one camera once",
          "[smoother][triangulate]") {
  Random random(18);
  const Rig rig = makeRig(RigKind::kEuroc).rig;
  int refused = 0;
  constexpr int kTrials = 50;
  for (int trial = 0; trial < kTrials; ++trial) {
    const test::WindowScene scene = test::sceneAround(rig, 2, 1e-6, random);
    // Both cameras at one instant; the rays diverge by 5 degrees, so they meet behind.
    Sighting sighting;
    sighting.slot = 0;
    const SE3 T_cam0_cam1 = rig.T_body_cam[0].inverse() * rig.T_body_cam[1];
    const Eigen::Vector3d ray0 = expSo3(randomVector(random, 0.1)) * Eigen::Vector3d::UnitZ();
    const Eigen::Vector3d out = T_cam0_cam1.translation.normalized();
    const Eigen::Vector3d ray1 = T_cam0_cam1.rotation.conjugate() * (ray0 + 0.09 * out).normalized();
    REQUIRE(sightingOf(rig.camera[0], ray0, kPixelSigma, sighting.camera[0]));
    REQUIRE(sightingOf(rig.camera[1], ray1, kPixelSigma, sighting.camera[1]));
    LandmarkPoint point;
    const std::vector<Sighting> both{sighting};
    const bool accepted = triangulate(scene.poses, both, 10, point);
    // The inverse depth is held at 0 and above, so what is left is a direction that fits badly.
    if (!accepted || meanSquaredResidual(scene.poses, both, point) > 3.5 * 3.5) ++refused;

    sighting.camera[1].used = false;
    const std::vector<Sighting> one{sighting};
    LandmarkPoint other;
    CHECK_FALSE(triangulate(scene.poses, one, 10, other));
    CHECK_FALSE(triangulate(scene.poses, {}, 10, other));
  }
  CHECK(refused == kTrials);
}

TEST_CASE("Triangulation refuses sightings whose rays point apart", "[smoother][triangulate]") {
  Random random(19);
  const Rig rig = makeRig(RigKind::kEuroc).rig;
  const test::WindowScene scene = test::sceneAround(rig, 2, 0.3, random);
  std::vector<Sighting> sightings(2);
  for (std::uint32_t k = 0; k < 2; ++k) {
    sightings[k].slot = k;
    // Two world directions more than 90 degrees apart: no point is in front of both.
    const Eigen::Vector3d world = k == 0 ? Eigen::Vector3d(1, 0.1, 0) : Eigen::Vector3d(-1, 0.1, 0);
    const Eigen::Vector3d ray = (scene.poses[k].current[0].R_cam_world * world).normalized();
    sightings[k].camera[0] = CameraSighting::of(ray, test::tangentWeight(ray, 400 / kPixelSigma));
  }
  LandmarkPoint point;
  CHECK_FALSE(triangulate(scene.poses, sightings, 10, point));
}

TEST_CASE("Tangent basis: orthonormal at every bearing", "[smoother][vision_factor]") {
  Random random(20);
  for (int k = 0; k < 300; ++k) {
    const Eigen::Vector3d b = k == 0   ? Eigen::Vector3d(Eigen::Vector3d::UnitZ())
                              : k == 1 ? Eigen::Vector3d(-Eigen::Vector3d::UnitX())
                                       : Eigen::Vector3d(randomVector(random, 1).normalized());
    const PointBasis basis = PointBasis::of(b);
    Eigen::Matrix3d M;
    M << b, basis.b1, basis.b2;
    CHECK((M.transpose() * M - Eigen::Matrix3d::Identity()).norm() < 1e-12);
  }
}
