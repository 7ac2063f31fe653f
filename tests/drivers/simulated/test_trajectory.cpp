#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>
#include <filesystem>

#include "drivers/simulated/flight_path.hpp"
#include "drivers/simulated/given_motion.hpp"
#include "drivers/simulated/spline_trajectory.hpp"
#include "estimator/core/random.hpp"
#include "estimator/geometry/so3.hpp"
#include "tests/support/skip_case.hpp"

namespace swiftlet {
namespace {

std::vector<SE3> randomPoses(std::size_t count, std::uint64_t seed) {
  Random random(seed);
  std::vector<SE3> poses;
  Eigen::Quaterniond q(random.normal(), random.normal(), random.normal(), random.normal());
  Eigen::Vector3d p = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < count; ++i) {
    p += 0.3 * Eigen::Vector3d(random.normal(), random.normal(), random.normal());
    q = q.normalized() * expSo3(0.3 * Eigen::Vector3d(random.normal(), random.normal(), random.normal()));
    poses.emplace_back(q, p);
  }
  return poses;
}

Tour squareTour() { return {{{2, 2, 1.5}, {-2, 2, 1.2}, {-2, -2, 1.8}, {2, -2, 1.4}}, 0.0}; }

void checkDerivatives(const SplineTrajectory& trajectory, double t) {
  constexpr double kStep = 1e-5;
  const MotionState state = trajectory.at(t);
  const MotionState before = trajectory.at(t - kStep);
  const MotionState after = trajectory.at(t + kStep);
  const Eigen::Vector3d velocity =
      (after.T_world_body.translation - before.T_world_body.translation) / (2 * kStep);
  const Eigen::Vector3d acceleration = (after.v_world_body - before.v_world_body) / (2 * kStep);
  const Eigen::Vector3d omega =
      logSo3(before.T_world_body.rotation.conjugate() * after.T_world_body.rotation) / (2 * kStep);
  const Eigen::Vector3d alpha = (after.omega_body - before.omega_body) / (2 * kStep);
  CHECK((velocity - state.v_world_body).norm() < 1e-6 * (1 + velocity.norm()));
  CHECK((acceleration - state.a_world_body).norm() < 1e-6 * (1 + acceleration.norm()));
  CHECK((omega - state.omega_body).norm() < 1e-6 * (1 + omega.norm()));
  CHECK((alpha - state.alpha_body).norm() < 1e-6 * (1 + alpha.norm()));
}

TEST_CASE("spline derivatives are those of the motion") {
  const SplineTrajectory trajectory(3.0, 0.2, randomPoses(30, 5));
  REQUIRE(trajectory.startTime() == 3.0);
  REQUIRE(trajectory.endTime() == Approx(3.0 + 25 * 0.2));
  Random random(1);
  for (int i = 0; i < 50; ++i) {
    checkDerivatives(trajectory, random.uniform(trajectory.startTime() + 0.01, trajectory.endTime() - 0.01));
  }
}

TEST_CASE("spline is continuous to the second derivative at the knots") {
  const SplineTrajectory trajectory(0.0, 0.1, randomPoses(20, 6));
  for (int k = 1; k < 14; ++k) {
    const MotionState left = trajectory.at(0.1 * k - 1e-9);
    const MotionState right = trajectory.at(0.1 * k + 1e-9);
    CHECK((left.a_world_body - right.a_world_body).norm() < 1e-4 * (1 + left.a_world_body.norm()));
    CHECK((left.alpha_body - right.alpha_body).norm() < 1e-4 * (1 + left.alpha_body.norm()));
  }
}

TEST_CASE("spline interpolates the poses given") {
  const std::vector<SE3> poses = randomPoses(40, 7);
  const SplineTrajectory trajectory = SplineTrajectory::interpolate(0.0, 0.05, poses);
  REQUIRE(trajectory.endTime() == Approx(39 * 0.05));
  for (std::size_t k = 0; k < poses.size(); ++k) {
    const SE3 pose = trajectory.pose(0.05 * static_cast<double>(k));
    CHECK((pose.translation - poses[k].translation).norm() < 1e-7);
    CHECK(logSo3(pose.rotation.conjugate() * poses[k].rotation).norm() < 1e-7);
  }
}

TEST_CASE("a flight rests exactly, moves at about its speed and keeps thrust along the body") {
  FlightSettings settings;
  settings.duration = 30;
  settings.rest_at_start = 3;
  settings.rests = {{15, 3, false}};
  settings.R_flu_body = eurocBodyAxes();
  const SplineTrajectory trajectory = flyTour(squareTour(), settings);
  REQUIRE(trajectory.startTime() <= 0.0);
  REQUIRE(trajectory.endTime() >= settings.duration);
  for (const double t : {0.0, 1.0, 2.6, 15.4, 16.5, 17.6}) {
    const MotionState state = trajectory.at(t);
    CHECK(state.v_world_body.norm() < 1e-12);
    CHECK(state.omega_body.norm() < 1e-12);
    // Level at rest: EuRoC's x axis points up.
    CHECK((state.T_world_body.rotation * Eigen::Vector3d::UnitX()).z() > 1 - 1e-12);
  }
  double length = 0;
  double tilt_error = 0;
  double time_in_motion = 0;
  for (double t = 4.0; t < 30; t += 0.01) {
    const MotionState state = trajectory.at(t);
    if (t > 14 && t < 19) continue;
    length += 0.01 * state.v_world_body.norm();
    time_in_motion += 0.01;
    const Eigen::Vector3d force = state.a_world_body + Eigen::Vector3d(0, 0, 9.81);
    const Eigen::Vector3d up = state.T_world_body.rotation * Eigen::Vector3d::UnitX();
    tilt_error = std::max(tilt_error, up.cross(force.normalized()).norm());
  }
  CHECK(length / time_in_motion == Approx(settings.speed).margin(0.3));
  CHECK(tilt_error < 0.05);  // rad: the spline rounds position and attitude a little differently
}

TEST_CASE("a flight in motion moves from the first instant and depends on the seed only") {
  FlightSettings settings;
  settings.duration = 5;
  const SplineTrajectory a = flyTour(squareTour(), settings);
  const SplineTrajectory b = flyTour(squareTour(), settings);
  settings.seed = 2;
  const SplineTrajectory c = flyTour(squareTour(), settings);
  CHECK(a.at(0).v_world_body.norm() > 0.2);
  CHECK(a.pose(3).translation == b.pose(3).translation);
  CHECK((a.pose(3).translation - c.pose(3).translation).norm() > 1e-3);
}

TEST_CASE("take-off begins on the floor") {
  FlightSettings settings;
  settings.duration = 12;
  settings.rest_at_start = 3;
  settings.start_on_ground = true;
  const SplineTrajectory trajectory = flyTour(squareTour(), settings);
  CHECK(trajectory.pose(1).translation.z() < 0.3);
  CHECK(trajectory.pose(11).translation.z() > 1.0);
}

TEST_CASE("hover drifts by centimetres") {
  FlightSettings settings;
  settings.duration = 30;
  settings.rests = {{10, 10, true}};
  const SplineTrajectory trajectory = flyTour(squareTour(), settings);
  const Eigen::Vector3d centre = trajectory.pose(15).translation;
  double widest = 0;
  double fastest = 0;
  for (double t = 11; t < 20; t += 0.1) {
    widest = std::max(widest, (trajectory.pose(t).translation - centre).norm());
    fastest = std::max(fastest, trajectory.at(t).v_world_body.norm());
  }
  CHECK(widest > 0.005);
  CHECK(widest < 0.3);
  CHECK(fastest < 0.3);
}

TEST_CASE("a recorded motion is passed through at the knots") {
  const char* data = std::getenv("SWIFTLET_DATA");
  const std::filesystem::path folder = data != nullptr ? data : SWIFTLET_DEFAULT_DATA;
  const std::filesystem::path path = folder / "euroc_imu_gt_all/V1_02_medium/groundtruth.csv.xz";
  if (!std::filesystem::exists(path)) {
    skipCase("no " + path.string(), kRunWithData);
    return;
  }
  const SplineTrajectory trajectory = readGivenMotion(path.string(), 5.0, 20.0);
  REQUIRE(trajectory.endTime() == Approx(20.0).margin(0.06));
  checkDerivatives(trajectory, 7.123);
  // The recorded speed is another estimate of the same motion: close, not equal.
  const MotionState state = trajectory.at(10.0);
  CHECK(state.v_world_body.norm() > 0.05);
  CHECK(state.v_world_body.norm() < 3.0);
  CHECK_THROWS_WITH(readGivenMotion("nowhere.csv"), Catch::Contains("nowhere.csv"));
}

}  // namespace
}  // namespace swiftlet
