#pragma once
// Messages from the values of the vector files, and back.

#include <cmath>
#include <string>

#include "drivers/mavlink/mavlink_link.hpp"
#include "drivers/mavlink/mavlink_messages.hpp"
#include "tests/drivers/protocol_vectors.hpp"

namespace swiftlet::test {

inline Eigen::Vector3f vectorOf(const nlohmann::json& values, const char* key) {
  if (!values.contains(key)) return Eigen::Vector3f::Zero();
  const nlohmann::json& v = values[key];
  return {v[0].get<float>(), v[1].get<float>(), v[2].get<float>()};
}

inline mavlink::HighresImu highresImuOf(const nlohmann::json& v) {
  mavlink::HighresImu m;
  m.time_usec = v["time_usec"];
  m.accel = vectorOf(v, "acc");
  m.gyro = vectorOf(v, "gyro");
  m.mag = vectorOf(v, "mag");
  m.abs_pressure = v.value("abs_pressure", 0.0F);
  m.diff_pressure = v.value("diff_pressure", 0.0F);
  m.pressure_alt = v.value("pressure_alt", 0.0F);
  m.temperature = v.value("temperature", 0.0F);
  m.fields_updated = v["fields_updated"];
  m.id = v.value("id", std::uint8_t{0});
  return m;
}

inline mavlink::Timesync timesyncOf(const nlohmann::json& v) {
  return {v["tc1"], v["ts1"], v["target_system"], v["target_component"]};
}

inline bool same(const mavlink::HighresImu& a, const mavlink::HighresImu& b) {
  return a.time_usec == b.time_usec && a.accel == b.accel && a.gyro == b.gyro && a.mag == b.mag &&
         a.abs_pressure == b.abs_pressure && a.diff_pressure == b.diff_pressure &&
         a.pressure_alt == b.pressure_alt && a.temperature == b.temperature &&
         a.fields_updated == b.fields_updated && a.id == b.id;
}

inline bool same(const mavlink::Timesync& a, const mavlink::Timesync& b) {
  return a.tc1 == b.tc1 && a.ts1 == b.ts1 && a.target_system == b.target_system &&
         a.target_component == b.target_component;
}

/// Everything that comes out of `bytes` fed in pieces of `piece` (0: whole).
inline std::vector<MavlinkFrame> parse(MavlinkParser& parser, const Bytes& bytes, std::size_t piece = 0) {
  std::vector<MavlinkFrame> frames;
  if (piece == 0) piece = MavlinkParser::kMostFed;
  for (std::size_t at = 0; at < bytes.size(); at += piece) {
    const std::size_t size = std::min(piece, bytes.size() - at);
    REQUIRE(parser.feed(std::span(bytes).subspan(at, size), Stamp{}, Duration{}) == size);
    MavlinkFrame frame;
    while (parser.next(frame)) frames.push_back(frame);
  }
  return frames;
}

}  // namespace swiftlet::test
