// What an autopilot is told, as an independent implementation writes it, in both directions.

#include "drivers/mavlink/vision_messages.hpp"
#include "tests/drivers/mavlink/mavlink_json.hpp"

namespace swiftlet::test {
namespace {

using nlohmann::json;

template <std::size_t N>
std::array<float, N> floats(const json& values) {
  std::array<float, N> out;
  for (std::size_t i = 0; i < N; ++i) out[i] = values[i].get<float>();
  return out;
}

mavlink::Odometry odometryOf(const json& v) {
  mavlink::Odometry m;
  m.time_usec = v["time_usec"];
  m.position = vectorOf(v, "position");
  m.q = floats<4>(v["q"]);
  m.velocity = vectorOf(v, "velocity");
  m.rates = vectorOf(v, "rates");
  m.pose_covariance = floats<21>(v["pose_covariance"]);
  m.velocity_covariance = floats<21>(v["velocity_covariance"]);
  m.frame = static_cast<mavlink::Frame>(v["frame"].get<int>());
  m.child = static_cast<mavlink::Frame>(v["child"].get<int>());
  m.reset_counter = v["reset_counter"];
  m.estimator = v["estimator"];
  m.quality = v["quality"];
  return m;
}

mavlink::VisionPositionEstimate estimateOf(const json& v) {
  mavlink::VisionPositionEstimate m;
  m.usec = v["usec"];
  m.position = vectorOf(v, "position");
  m.rpy = vectorOf(v, "rpy");
  m.covariance = floats<21>(v["covariance"]);
  m.reset_counter = v["reset_counter"];
  return m;
}

mavlink::ObstacleDistance obstaclesOf(const json& v) {
  mavlink::ObstacleDistance m;
  m.time_usec = v["time_usec"];
  m.sensor = v["sensor"];
  for (std::size_t i = 0; i < m.distance_cm.size(); ++i) m.distance_cm[i] = v["distance_cm"][i];
  m.min_cm = v["min_cm"];
  m.max_cm = v["max_cm"];
  m.increment_deg = v["increment_deg"];
  m.offset_deg = v["offset_deg"];
  m.frame = static_cast<mavlink::Frame>(v["frame"].get<int>());
  return m;
}

std::size_t writeVision(const std::string& kind, const json& v, MavlinkSender& sender,
                        std::span<std::uint8_t> out) {
  if (kind == "ODOMETRY") return mavlink::write(sender, odometryOf(v), out);
  if (kind == "VISION_POSITION_ESTIMATE") return mavlink::write(sender, estimateOf(v), out);
  if (kind == "OBSTACLE_DISTANCE") return mavlink::write(sender, obstaclesOf(v), out);
  const auto text = v["text"].get<std::string>();
  const auto severity = static_cast<mavlink::StatusText::Severity>(v["severity"].get<int>());
  return mavlink::write(sender, mavlink::StatusText{severity, text, v["id"], v["chunk"]}, out);
}

/// What was read, written again: all fields came through, or the bytes differ.
std::size_t writeAgain(const MavlinkFrame& frame, MavlinkSender& sender, std::span<std::uint8_t> out) {
  mavlink::Odometry odometry;
  mavlink::VisionPositionEstimate estimate;
  mavlink::ObstacleDistance obstacles;
  if (mavlink::read(frame, odometry)) return mavlink::write(sender, odometry, out);
  if (mavlink::read(frame, estimate)) return mavlink::write(sender, estimate, out);
  if (mavlink::read(frame, obstacles)) return mavlink::write(sender, obstacles, out);
  mavlink::StatusText text;
  if (mavlink::read(frame, text)) return mavlink::write(sender, text, out);
  return 0;
}

TEST_CASE("What an autopilot is told is written as node-mavlink writes it, and read back", "[mavlink]") {
  const json vectors = protocolVectors("mavlink_vision_vectors.json");
  REQUIRE(vectors["frames"].size() == 200);
  for (const json& vector : vectors["frames"]) {
    const std::string kind = vector["message"];
    const auto hex = vector["hex"].get<std::string>();
    INFO(kind << " " << hex);
    CHECK(knownCrcExtra(vector["id"]) == vector["extra"].get<std::uint8_t>());
    const MavlinkSender fresh = {vector["system"], vector["component"], vector["sequence"]};
    MavlinkSender sender = fresh;
    std::array<std::uint8_t, kLongestMavlinkFrame> out = {};
    CHECK(hexOf(std::span(out).first(writeVision(kind, vector["values"], sender, out))) == hex);
    MavlinkParser parser;
    const auto frames = parse(parser, bytesOf(vector));
    REQUIRE(frames.size() == 1);
    sender = fresh;
    CHECK(hexOf(std::span(out).first(writeAgain(frames[0], sender, out))) == hex);
  }
}

}  // namespace
}  // namespace swiftlet::test
