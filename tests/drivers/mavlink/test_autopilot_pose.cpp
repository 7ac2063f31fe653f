// What an autopilot is told: signs, axes, lever arm, covariance; the recorded frames byte for byte.

#include <catch2/catch.hpp>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

#include "drivers/mavlink/autopilot_pose.hpp"
#include "drivers/mavlink/mavlink_link.hpp"
#include "estimator/core/random.hpp"
#include "estimator/geometry/so3.hpp"

namespace swiftlet {
namespace {

using Eigen::Quaterniond;
using Eigen::Vector3d;
using Eigen::Vector3f;

std::string goldenHex(const std::string& name) {
  std::ifstream file(std::string(SWIFTLET_TEST_DATA) + "/protocols/mavlink.json");
  const auto golden = nlohmann::json::parse(file);
  const auto& entries = golden.is_array() ? golden : golden.at("frames");
  for (const auto& entry : entries) {
    if (entry.at("name") == name) return entry.at("hex");
  }
  return {};
}

template <typename Message>
std::string hexOf(const Message& message, std::uint8_t sequence) {
  MavlinkSender sender;
  sender.sequence = sequence;
  std::array<std::uint8_t, kLongestMavlinkFrame> bytes;
  const std::size_t length = mavlink::write(sender, message, bytes);
  std::string hex;
  constexpr const char* kDigits = "0123456789abcdef";
  for (std::size_t i = 0; i < length; ++i) hex += {kDigits[bytes[i] >> 4U], kDigits[bytes[i] & 15U]};
  return hex;
}

std::uint8_t sequenceOf(const std::string& hex) {
  constexpr int kHexadecimal = 16;
  return static_cast<std::uint8_t>(std::stoi(hex.substr(8, 2), nullptr, kHexadecimal));
}

/// Covariance of a frame as it was recorded: variances alone.
mavlink::Covariance21 variances(const std::array<float, 6>& diagonal) {
  mavlink::Covariance21 packed{};
  std::size_t index = 0;
  for (std::size_t row = 0; row < 6; ++row) {
    packed[index] = diagonal[row];
    index += 6 - row;
  }
  return packed;
}

NavState stateAt(const Quaterniond& q, const Vector3d& p, const Vector3d& v_body) {
  NavState state;
  state.T_world_body = {q, p};
  state.v_world_body = q * v_body;
  state.health = Health::kGood;
  return state;
}

TEST_CASE("The recorded ODOMETRY comes out of the state that it was made of, byte for byte", "[mavlink]") {
  NavState state = stateAt({0.5, 0.5, 0.5, -0.5}, {1.5, 2.25, 0.75}, {0.5, 0.125, -0.25});
  state.stamp = Stamp{987'654'321'000};
  state.epoch = 3;
  mavlink::Odometry message = odometryOf(state, {0.0625, 0.03125, -0.015625}, {});
  message.pose_covariance = variances({0.01F, 0.01F, 0.04F, 0.0025F, 0.0025F, 0.01F});
  message.velocity_covariance = variances({0.0625F, 0.0625F, 0.0625F, 0.00390625F, 0.00390625F, 0.00390625F});
  message.quality = 87;
  const std::string golden = goldenHex("ml2_odometry");
  REQUIRE(!golden.empty());
  CHECK(hexOf(message, sequenceOf(golden)) == golden);
}

TEST_CASE("The recorded VISION_POSITION_ESTIMATE is written byte for byte", "[mavlink]") {
  mavlink::VisionPositionEstimate message;
  message.usec = 5555555;
  message.position = {0.5F, 1.25F, -2.0F};
  message.rpy = {0.0625F, -0.125F, 1.5F};
  message.covariance = variances({0.01F, 0.01F, 0.04F, 0.0025F, 0.0025F, 0.01F});
  message.reset_counter = 4;
  const std::string golden = goldenHex("ml2_vision_position_estimate");
  REQUIRE(!golden.empty());
  CHECK(hexOf(message, sequenceOf(golden)) == golden);
}

TEST_CASE("Forward is +x, right +y, up -z; nose up is +pitch, clockwise from above +yaw", "[mavlink]") {
  const Vector3d up = Vector3d::UnitZ();
  const Vector3d left = Vector3d::UnitY();
  const auto position = [](const Vector3d& p) {
    return odometryOf(stateAt(Quaterniond::Identity(), p, Vector3d::Zero()), Vector3d::Zero(), {}).position;
  };
  CHECK(position({1, 0, 0}) == Vector3f(1, 0, 0));
  CHECK(position(-left) == Vector3f(0, 1, 0));
  CHECK(position(up) == Vector3f(0, 0, -1));
  const auto angles = [](const Vector3d& turn) {
    return positionEstimateOf(stateAt(Quaterniond(expSo3(turn)), Vector3d::Zero(), Vector3d::Zero()), {}).rpy;
  };
  constexpr double kTurn = 0.2;
  CHECK(angles(-kTurn * left).y() == Approx(kTurn));  // z up: nose up turns about the right-hand side
  CHECK(angles(-kTurn * up).z() == Approx(kTurn));
  CHECK(angles({kTurn, 0, 0}).x() == Approx(kTurn));
}

TEST_CASE("A turned IMU away from the centre is told as the vehicle's reference point", "[mavlink]") {
  // The IMU looks to the left, 0.2 m in front of the centre: the centre is 0.2 m to its... right-hand axes.
  AutopilotMounting mounting;
  mounting.q_vehicle_body = Quaterniond(expSo3({0, 0, M_PI / 2}));
  mounting.p_body_vehicle = mounting.q_vehicle_body.conjugate() * Vector3d(-0.2, 0, 0);
  // The vehicle looks along the world's x and turns left on the spot about its centre at 1 rad/s.
  const Quaterniond q_world_vehicle = Quaterniond::Identity();
  NavState state;
  state.T_world_body = {q_world_vehicle * mounting.q_vehicle_body, Vector3d(3.2, 1, 2)};
  state.v_world_body = Vector3d(0, 0.2, 0);
  const Vector3d omega_body = mounting.q_vehicle_body.conjugate() * Vector3d::UnitZ();
  const mavlink::Odometry message = odometryOf(state, omega_body, mounting);
  CHECK((message.position - Vector3f(3, -1, -2)).norm() < 1e-6F);
  CHECK(message.q[0] == Approx(1));
  CHECK(message.velocity.norm() < 1e-6F);
  CHECK((message.rates - Vector3f(0, 0, -1)).norm() < 1e-6F);
}

TEST_CASE("Covariances follow from the state's by differentiation", "[mavlink]") {
  Random random(5);
  const auto vector = [&] { return Vector3d(random.normal(), random.normal(), random.normal()); };
  AutopilotMounting mounting;
  mounting.q_vehicle_body = Quaterniond(expSo3(vector()));
  mounting.p_body_vehicle = 0.3 * vector();
  NavState state = stateAt(Quaterniond(expSo3(vector())), vector(), vector());
  Matrix15d root;
  for (int i = 0; i < root.size(); ++i) root.data()[i] = 0.1 * random.normal();
  state.covariance = root * root.transpose();
  const Vector3d omega = Vector3d::Zero();
  constexpr double kStep = 1e-6;
  // Position, world-turned angle, velocity in the vehicle's axes, each in FRD, by central differences.
  Eigen::Matrix<double, 9, kStateDim> J;
  const Eigen::DiagonalMatrix<double, 3> M(1, -1, -1);
  const auto moved = [&](int column, double by) {
    Eigen::Matrix<double, kStateDim, 1> d = Eigen::Matrix<double, kStateDim, 1>::Zero();
    d[column] = by;
    const Quaterniond q = state.T_world_body.rotation * Quaterniond(expSo3(d.head<3>()));
    const Vector3d p = state.T_world_body.translation + d.segment<3>(3);
    const Vector3d v = state.v_world_body + d.segment<3>(6);
    Eigen::Matrix<double, 9, 1> out;
    out.head<3>() = M * (p + q * mounting.p_body_vehicle);
    out.segment<3>(3) = M * logSo3(q * state.T_world_body.rotation.conjugate());
    out.tail<3>() = M * (mounting.q_vehicle_body * (q.conjugate() * v));
    return out;
  };
  for (int i = 0; i < kStateDim; ++i) J.col(i) = (moved(i, kStep) - moved(i, -kStep)) / (2 * kStep);
  const Eigen::Matrix<double, 9, 9> wanted = J * state.covariance * J.transpose();
  const mavlink::Odometry message = odometryOf(state, omega, mounting);
  std::size_t index = 0;
  for (int row = 0; row < 6; ++row) {
    for (int column = row; column < 6; ++column, ++index) {
      CHECK(message.pose_covariance[index] == Approx(wanted(row, column)).epsilon(1e-4).margin(1e-6));
      if (column < 3) {
        CHECK(message.velocity_covariance[index] ==
              Approx(wanted(row + 6, column + 6)).epsilon(1e-4).margin(1e-6));
      }
    }
  }
}

TEST_CASE("Health is told as autopilots understand it, and what is written is read back", "[mavlink]") {
  CHECK(qualityOf(Health::kGood) == 100);
  CHECK(qualityOf(Health::kFailed) == -1);
  CHECK(qualityOf(Health::kInitializing) == 0);
  CHECK(qualityOf(Health::kDegraded) > 0);
  mavlink::ObstacleDistance sent;
  for (std::size_t i = 0; i < sent.distance_cm.size(); ++i)
    sent.distance_cm[i] = static_cast<std::uint16_t>(100 * i);
  sent.min_cm = 20;
  sent.max_cm = 900;
  sent.offset_deg = -2.5F;
  MavlinkSender sender;
  std::array<std::uint8_t, kLongestMavlinkFrame> bytes;
  const std::size_t length = mavlink::write(sender, sent, bytes);
  MavlinkParser parser;
  REQUIRE(parser.feed(std::span(bytes).first(length), Stamp{1}, Duration{}) == length);
  MavlinkFrame frame;
  REQUIRE(parser.next(frame));
  mavlink::ObstacleDistance received;
  REQUIRE(mavlink::read(frame, received));
  CHECK(received.distance_cm == sent.distance_cm);
  CHECK(received.increment_deg == 5);
  CHECK(received.offset_deg == -2.5F);
  CHECK(received.frame == mavlink::Frame::kBodyFrd);
}

}  // namespace
}  // namespace swiftlet
