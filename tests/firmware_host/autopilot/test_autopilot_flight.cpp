// A known flight (forward, right, up, clockwise, forward, nose up, roll right) as an IMU that is mounted
// anyhow senses it, propagated as in flight, and what an autopilot is told of it.

#include <catch2/catch.hpp>

#include <array>
#include <cmath>
#include <iostream>
#include <numbers>

#include "estimator/geometry/so3.hpp"
#include "estimator/imu/propagation.hpp"
#include "firmware_host/outputs/autopilot/autopilot_thread.hpp"

namespace swiftlet {
namespace {

using Eigen::Quaterniond;
using Eigen::Vector3d;

constexpr double kRight = std::numbers::pi / 2;
constexpr double kNoseUp = 0.2;
constexpr double kRoll = 0.3;
constexpr double kLegSeconds = 2;
constexpr Stamp kBegin{40'000'000'000};
const Eigen::DiagonalMatrix<double, 3> kFrd(1, -1, -1);

/// The vehicle's centre and attitude as an autopilot counts them: forward, right, down; roll, pitch, yaw.
struct Told {
  Vector3d p;
  Vector3d rpy;
};

/// At the end of each leg; the first is the start.
const std::array<Told, 8> kLegs = {{{{0, 0, 0}, {0, 0, 0}},
                                    {{2, 0, 0}, {0, 0, 0}},
                                    {{2, 1.5, 0}, {0, 0, 0}},
                                    {{2, 1.5, -1}, {0, 0, 0}},
                                    {{2, 1.5, -1}, {0, 0, kRight}},
                                    {{2, 2.5, -1}, {0, 0, kRight}},
                                    {{2, 2.5, -1}, {0, kNoseUp, kRight}},
                                    {{2, 2.5, -1}, {kRoll, kNoseUp, kRight}}}};
constexpr double kEnd = kLegSeconds * 7;

/// From rest to rest, with a steady acceleration.
Told toldAt(double t) {
  const double legs = std::clamp(t / kLegSeconds, 0.0, 7.0);
  const auto leg = std::min(static_cast<std::size_t>(legs), std::size_t{6});
  const double u = legs - static_cast<double>(leg);
  const double s = u * u * u * (10 + u * (6 * u - 15));
  return {kLegs[leg].p + s * (kLegs[leg + 1].p - kLegs[leg].p),
          kLegs[leg].rpy + s * (kLegs[leg + 1].rpy - kLegs[leg].rpy)};
}

/// FRD axes to the local frame's.
Quaterniond attitude(const Vector3d& rpy) {
  return Eigen::AngleAxisd(rpy.z(), Vector3d::UnitZ()) * Eigen::AngleAxisd(rpy.y(), Vector3d::UnitY()) *
         Eigen::AngleAxisd(rpy.x(), Vector3d::UnitX());
}

/// The IMU in a world with z up, by its mounting: written from the drawing, not from the code under test.
SE3 imuAt(double t, const AutopilotMounting& mounting) {
  const Told told = toldAt(t);
  const Eigen::Matrix3d R_world_vehicle = kFrd * attitude(told.rpy).toRotationMatrix() * kFrd;
  const Quaterniond q(R_world_vehicle * mounting.q_vehicle_body.toRotationMatrix());
  return {q, kFrd * told.p - q * mounting.p_body_vehicle};
}

struct Motion {
  Vector3d velocity, acceleration, omega_body;
};

Motion motionAt(double t, const AutopilotMounting& mounting) {
  constexpr double kStep = 1e-3;
  const SE3 before = imuAt(t - kStep, mounting);
  const SE3 here = imuAt(t, mounting);
  const SE3 after = imuAt(t + kStep, mounting);
  return {(after.translation - before.translation) / (2 * kStep),
          (after.translation - 2 * here.translation + before.translation) / (kStep * kStep),
          logSo3(before.rotation.conjugate() * after.rotation) / (2 * kStep)};
}

/// The newest of what was sent.
struct Autopilot {
  MavlinkParser parser;
  mavlink::Odometry pose;
  mavlink::VisionPositionEstimate estimate;
  int poses = 0, estimates = 0;

  void hear(std::span<const std::uint8_t> bytes) {
    REQUIRE(parser.feed(bytes, {}, {}) == bytes.size());
    for (MavlinkFrame frame; parser.next(frame);) {
      if (mavlink::read(frame, pose)) ++poses;
      if (mavlink::read(frame, estimate)) ++estimates;
    }
  }
};

AutopilotGroup mounted(int which) {
  AutopilotGroup settings;
  if (which == 0) return settings;
  settings.roll_deg = which == 1 ? 180 : -35;
  settings.pitch_deg = which == 1 ? 0 : 25;
  settings.yaw_deg = which == 1 ? 90 : -130;
  settings.arm_x = 0.12;
  settings.arm_y = -0.3;
  settings.arm_z = 0.07;
  return settings;
}

double secondsOf(std::uint64_t usec) {
  return static_cast<double>(usec) * 1e-6 - (kBegin - Stamp{}).seconds();
}

Quaterniond quaternionOf(const mavlink::Odometry& pose) {
  return {pose.q[0], pose.q[1], pose.q[2], pose.q[3]};
}

struct Worst {
  double position = 0, angle = 0, velocity = 0, rate = 0;
};

void compare(const mavlink::Odometry& pose, Worst& worst) {
  const double t = secondsOf(pose.time_usec);
  const Told told = toldAt(t);
  const Motion of_centre = motionAt(t, {});
  const Quaterniond q_wanted = attitude(told.rpy);
  const Quaterniond q = quaternionOf(pose);
  const Vector3d v_wanted = q_wanted.conjugate() * (kFrd * of_centre.velocity);
  const Vector3d rates_wanted = kFrd * of_centre.omega_body;
  worst.position = std::max(worst.position, (pose.position.cast<double>() - told.p).norm());
  worst.angle = std::max(worst.angle, q.angularDistance(q_wanted));
  worst.velocity = std::max(worst.velocity, (pose.velocity.cast<double>() - v_wanted).norm());
  worst.rate = std::max(worst.rate, (pose.rates.cast<double>() - rates_wanted).norm());
}

TEST_CASE("A known flight is told in the autopilot's axes, however the IMU is mounted", "[autopilot]") {
  const int which = GENERATE(0, 1, 2);
  AutopilotGroup settings = mounted(which);
  const AutopilotLinkSettings by_odometry = linkSettings(settings);
  settings.message = "vision_position_estimate";
  const AutopilotLinkSettings by_estimate = linkSettings(settings);
  REQUIRE_FALSE(by_odometry.position_estimate);
  REQUIRE(by_estimate.position_estimate);
  const AutopilotMounting& mounting = by_odometry.mounting;
  AutopilotLink odometry(by_odometry), estimate(by_estimate);
  Autopilot first, second;

  Propagator propagator{ImuNoise{}};
  NavState state;
  state.stamp = kBegin;
  state.health = Health::kGood;
  state.T_world_body = imuAt(0, mounting);
  REQUIRE(propagator.setState(state).ok());
  Worst worst;
  constexpr int kRate = 200;
  for (int i = 0; i <= static_cast<int>(kEnd) * kRate; ++i) {
    const double t = static_cast<double>(i) / kRate;
    const Motion motion = motionAt(t, mounting);
    ImuSample sample;
    sample.stamp = kBegin + Duration::fromSeconds(t);
    sample.gyro = motion.omega_body;
    sample.accel = imuAt(t, mounting).rotation.conjugate() * (motion.acceleration + Vector3d(0, 0, 9.81));
    static_cast<void>(propagator.step(sample, &state));
    const Stamp now = state.stamp + Duration::fromMilliseconds(2);
    std::array<std::uint8_t, AutopilotLink::kMostBytes> bytes;
    const int before = first.poses;
    first.hear(std::span(bytes).first(odometry.step(now, &state, sample.gyro, bytes)));
    second.hear(std::span(bytes).first(estimate.step(now, &state, sample.gyro, bytes)));
    if (first.poses == before) continue;
    compare(first.pose, worst);
    // The alternative says the same of position and attitude.
    REQUIRE(second.estimate.usec == first.pose.time_usec);
    REQUIRE((second.estimate.position - first.pose.position).norm() < 1e-6F);
    const Quaterniond q = attitude(second.estimate.rpy.cast<double>());
    REQUIRE(q.angularDistance(quaternionOf(first.pose)) < 1e-5);
    REQUIRE(second.estimate.covariance == first.pose.pose_covariance);
  }
  std::cout << "mounting " << which << ": " << first.poses << " poses, worst off by " << 1e3 * worst.position
            << " mm, " << 1e3 * worst.angle << " mrad, " << 1e3 * worst.velocity << " mm/s, "
            << 1e3 * worst.rate << " mrad/s\n";
  CHECK(first.poses > 500);
  CHECK(second.estimates == first.poses);
  // Propagation of samples 5 ms apart, over 14 s; a sign or an arm that is wrong is off by decimetres.
  CHECK(worst.position < 0.01);
  CHECK(worst.angle < 2e-3);
  CHECK(worst.velocity < 0.01);
  CHECK(worst.rate < 2e-3);
}

TEST_CASE("The settings' angles turn the IMU in the vehicle: roll, then pitch, then yaw", "[autopilot]") {
  const Vector3d forward = Vector3d::UnitX(), left = Vector3d::UnitY(), up = Vector3d::UnitZ();
  struct Turned {
    double roll, pitch, yaw;
    Vector3d x, y, z;  ///< where the IMU's axes point in the vehicle
  };
  const std::array<Turned, 8> cases = {{{0, 0, 0, forward, left, up},
                                        {90, 0, 0, forward, up, -left},
                                        {0, 90, 0, -up, left, forward},
                                        {0, 0, 90, left, -forward, up},
                                        {90, 0, 90, left, up, forward},
                                        {90, 90, 0, -up, forward, -left},
                                        // A flight controller's: x forward, y right, z down.
                                        {180, 0, 0, forward, -left, -up},
                                        // EuRoC's: x up, y right, z forward.
                                        {0, -90, 180, up, -left, forward}}};
  for (const Turned& turned : cases) {
    AutopilotGroup settings;
    settings.roll_deg = turned.roll;
    settings.pitch_deg = turned.pitch;
    settings.yaw_deg = turned.yaw;
    const Quaterniond q = linkSettings(settings).mounting.q_vehicle_body;
    INFO(turned.roll << " " << turned.pitch << " " << turned.yaw);
    CHECK((q * forward - turned.x).norm() < 1e-9);
    CHECK((q * left - turned.y).norm() < 1e-9);
    CHECK((q * up - turned.z).norm() < 1e-9);
  }
}

}  // namespace
}  // namespace swiftlet
