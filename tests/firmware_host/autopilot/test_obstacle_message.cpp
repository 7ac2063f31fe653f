// A known wall, through the message's bytes, in the sectors in which an autopilot looks for it.

#include <catch2/catch.hpp>
#include <cmath>
#include <memory>
#include <numbers>

#include "drivers/mavlink/mavlink_link.hpp"
#include "firmware_host/outputs/autopilot/autopilot_thread.hpp"
#include "firmware_host/outputs/autopilot/obstacle_message.hpp"

namespace swiftlet {
namespace {

constexpr double kDegree = std::numbers::pi / 180;
constexpr Stamp kNow{7'000'000'123};

/// A square of 2 m, upright, centred at `centre`, looking at the world's origin.
std::unique_ptr<LocalMesh> wallAt(const Eigen::Vector3d& centre) {
  auto mesh = std::make_unique<LocalMesh>();
  mesh->stamp = kNow;
  const Eigen::Vector3d along = centre.cross(Eigen::Vector3d::UnitZ()).normalized();
  const Eigen::Vector3d up = Eigen::Vector3d::UnitZ();
  for (const auto& [a, b] : {std::pair{-1, -1}, {1, -1}, {1, 1}, {-1, 1}}) {
    static_cast<void>(mesh->vertices.tryPushBack({0, (centre + a * along + b * up).cast<float>(), 0}));
  }
  static_cast<void>(mesh->faces.tryPushBack({{0, 1, 2}, kNoLabel}));
  static_cast<void>(mesh->faces.tryPushBack({{0, 2, 3}, kNoLabel}));
  return mesh;
}

mavlink::ObstacleDistance throughBytes(const mavlink::ObstacleDistance& message) {
  MavlinkSender sender;
  std::array<std::uint8_t, kLongestMavlinkFrame> bytes;
  const std::size_t length = mavlink::write(sender, message, bytes);
  MavlinkParser parser;
  REQUIRE(parser.feed(std::span(bytes).first(length), {}, {}) == length);
  MavlinkFrame frame;
  REQUIRE(parser.next(frame));
  mavlink::ObstacleDistance read;
  REQUIRE(mavlink::read(frame, read));
  return read;
}

TEST_CASE("A known wall is told in the sectors that look at it", "[autopilot]") {
  // The wall stands 4 m away, 30 degrees to the left of the world's x.
  const double bearing = 30 * kDegree;
  const auto mesh = wallAt(4 * Eigen::Vector3d(std::cos(bearing), std::sin(bearing), 0));
  AutopilotGroup settings;
  settings.roll_deg = GENERATE(0.0, 180.0);
  settings.pitch_deg = GENERATE(0.0, -20.0);
  settings.yaw_deg = GENERATE(0.0, 90.0, -135.0);
  const AutopilotMounting mounting = linkSettings(settings).mounting;

  for (const double heading_deg : {0.0, 30.0, 75.0, -150.0}) {
    NavState state;
    state.health = Health::kGood;
    state.stamp = kNow + Duration::fromMilliseconds(100);
    // The vehicle is level and looks along `heading`; the IMU is turned in it.
    const Eigen::Quaterniond q_world_vehicle(
        Eigen::AngleAxisd(heading_deg * kDegree, Eigen::Vector3d::UnitZ()));
    state.T_world_body = SE3(q_world_vehicle * mounting.q_vehicle_body, Eigen::Vector3d::Zero());
    const auto made = obstacleDistanceOf(*mesh, state, mounting);
    REQUIRE(made);
    const mavlink::ObstacleDistance told = throughBytes(*made);
    CHECK(told.frame == mavlink::Frame::kBodyFrd);
    CHECK(told.time_usec == static_cast<std::uint64_t>(kNow.ns / 1000));
    CHECK(told.max_cm == 2000);
    const double increment = told.increment_deg;
    for (std::size_t i = 0; i < told.distance_cm.size(); ++i) {
      // Clockwise from ahead; a bearing counts anticlockwise from the world's x.
      const double azimuth = heading_deg - (told.offset_deg + static_cast<double>(i) * increment);
      const double off = std::abs(std::remainder(azimuth - 30, 360.0));
      INFO("heading " << heading_deg << ", sector " << i);
      const double half_wall = std::atan2(1, 4) / kDegree;
      if (off < half_wall) {
        const double nearest = std::max(0.0, off - increment / 2);
        CHECK(std::abs(told.distance_cm[i] - 400 / std::cos(nearest * kDegree)) <= 1);
      } else if (off > half_wall + increment) {
        CHECK(told.distance_cm[i] == mavlink::ObstacleDistance::kUnknown);
      }
    }
  }
}

TEST_CASE("Distances count from the vehicle's reference point, what touches it is a step away",
          "[autopilot]") {
  const auto mesh = wallAt({4, 0, 0});
  AutopilotMounting mounting;
  mounting.p_body_vehicle = {1, 0, 0};
  NavState state;
  state.health = Health::kGood;
  state.stamp = kNow;
  CHECK(obstacleDistanceOf(*mesh, state, mounting)->distance_cm[0] == 300);
  state.T_world_body.translation.x() = 3;
  const auto touching = obstacleDistanceOf(*mesh, state, mounting);
  CHECK(touching->distance_cm[0] == touching->min_cm);
  CHECK(touching->min_cm > 0);
}

TEST_CASE("A sector seen whole beyond the reach is free up to there, one seen in part is unknown",
          "[autopilot]") {
  AutopilotMounting mounting;
  NavState state;
  state.stamp = kNow;
  state.health = Health::kDegraded;
  // The wall is 2 m wide: at 250 m it crosses a tenth of the sector.
  for (const double distance : {19.99, 20.01, 250.0}) {
    const auto made = obstacleDistanceOf(*wallAt({distance, 0, 0}), state, mounting);
    REQUIRE(made);
    const mavlink::ObstacleDistance told = throughBytes(*made);
    CHECK(told.max_cm == 2000);
    const int expected = distance < 20    ? 1999
                         : distance < 100 ? told.max_cm + 1
                                          : int{mavlink::ObstacleDistance::kUnknown};
    CHECK(told.distance_cm[0] == expected);
    for (std::size_t i = 5; i < told.distance_cm.size() - 5; ++i) {
      CHECK(told.distance_cm[i] == mavlink::ObstacleDistance::kUnknown);
    }
  }
}

TEST_CASE("An old mesh, one of another epoch, one from a lost state say nothing", "[autopilot]") {
  const auto mesh = wallAt({4, 0, 0});
  NavState state;
  state.health = Health::kGood;
  state.stamp = kNow + AutopilotLink::kOldestObstacles;
  CHECK(obstacleDistanceOf(*mesh, state, {}));
  state.stamp = state.stamp + Duration{1};
  CHECK_FALSE(obstacleDistanceOf(*mesh, state, {}));
  state.stamp = kNow;
  state.epoch = 1;
  CHECK_FALSE(obstacleDistanceOf(*mesh, state, {}));
  state.epoch = 0;
  CHECK(obstacleDistanceOf(*mesh, state, {}));
  for (const Health health : {Health::kInitializing, Health::kFailed}) {
    state.health = health;
    CHECK_FALSE(obstacleDistanceOf(*mesh, state, {}));
  }
}

}  // namespace
}  // namespace swiftlet
