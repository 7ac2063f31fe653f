// Random messages as an independent implementation writes them, in both directions.

#include "tests/drivers/mavlink/mavlink_json.hpp"

namespace swiftlet::test {
namespace {

using nlohmann::json;

/// What `values` say, as this project writes it.
std::size_t writeFrom(const std::string& kind, const json& v, MavlinkSender& sender,
                      std::span<std::uint8_t> out) {
  if (kind == "HIGHRES_IMU") return mavlink::write(sender, highresImuOf(v), out);
  if (kind == "TIMESYNC") return mavlink::write(sender, timesyncOf(v), out);
  if (kind == "HEARTBEAT") {
    mavlink::Heartbeat m;
    m = {v["custom_mode"], v["type"],          v["autopilot"],
         v["base_mode"],   v["system_status"], v["mavlink_version"]};
    return mavlink::write(sender, m, out);
  }
  if (kind == "COMMAND_LONG") {
    mavlink::CommandLong m;
    for (std::size_t i = 0; i < m.param.size(); ++i) m.param[i] = v["param"][i];
    m.command = v["command"];
    m.target_system = v["target_system"];
    m.target_component = v["target_component"];
    m.confirmation = v["confirmation"];
    return mavlink::write(sender, m, out);
  }
  mavlink::CameraTrigger m;
  m.time_usec = v["time_usec"];
  m.seq = v["seq"];
  return mavlink::write(sender, m, out);
}

mavlink::ScaledImu scaledImuOf(const std::string& kind, const json& v) {
  mavlink::ScaledImu m;
  constexpr std::uint64_t kUsPerMs = 1000;
  m.time_usec = kind == "RAW_IMU" ? v["time_usec"].get<std::uint64_t>()
                                  : kUsPerMs * v["time_boot_ms"].get<std::uint64_t>();
  for (int i = 0; i < 3; ++i) {
    m.accel[i] = v["acc"][static_cast<std::size_t>(i)];
    m.gyro[i] = v["gyro"][static_cast<std::size_t>(i)];
  }
  m.id = kind == "RAW_IMU" ? v["id"].get<std::uint8_t>() : std::uint8_t{0};
  return m;
}

/// Messages that are read and never written.
bool isReadOnly(const std::string& kind) {
  return kind == "SCALED_IMU" || kind == "RAW_IMU" || kind == "COMMAND_ACK";
}

/// Reads and checks the fields; false: not a message that is read.
bool readsAs(const std::string& kind, const json& v, const MavlinkFrame& frame) {
  mavlink::HighresImu imu;
  mavlink::Timesync timesync;
  mavlink::Heartbeat heartbeat;
  mavlink::CommandLong command;
  mavlink::CameraTrigger trigger;
  if (kind == "HIGHRES_IMU") return mavlink::read(frame, imu) && same(imu, highresImuOf(v));
  if (kind == "TIMESYNC") return mavlink::read(frame, timesync) && same(timesync, timesyncOf(v));
  if (kind == "HEARTBEAT") {
    return mavlink::read(frame, heartbeat) && heartbeat.custom_mode == v["custom_mode"] &&
           heartbeat.type == v["type"] && heartbeat.autopilot == v["autopilot"] &&
           heartbeat.base_mode == v["base_mode"] && heartbeat.system_status == v["system_status"] &&
           heartbeat.mavlink_version == v["mavlink_version"];
  }
  if (kind == "COMMAND_LONG") {
    if (!mavlink::read(frame, command)) return false;
    for (std::size_t i = 0; i < command.param.size(); ++i) {
      if (command.param[i] != v["param"][i].get<float>()) return false;
    }
    return command.command == v["command"] && command.target_system == v["target_system"] &&
           command.target_component == v["target_component"] && command.confirmation == v["confirmation"];
  }
  if (kind == "COMMAND_ACK") {
    mavlink::CommandAck ack;
    return mavlink::read(frame, ack) && ack.command == v["command"] && ack.result == v["result"];
  }
  if (isReadOnly(kind)) {
    mavlink::ScaledImu scaled;
    const mavlink::ScaledImu wanted = scaledImuOf(kind, v);
    return mavlink::read(frame, scaled) && scaled.time_usec == wanted.time_usec &&
           scaled.accel == wanted.accel && scaled.gyro == wanted.gyro && scaled.id == wanted.id;
  }
  return kind == "CAMERA_TRIGGER" && mavlink::read(frame, trigger) && trigger.time_usec == v["time_usec"] &&
         trigger.seq == v["seq"];
}

TEST_CASE("Messages that node-mavlink wrote are read, and written to the same bytes", "[mavlink]") {
  const json vectors = protocolVectors("mavlink_vectors.json");
  REQUIRE(vectors["frames"].size() >= 300);
  std::size_t checked = 0;
  for (const json& vector : vectors["frames"]) {
    const std::string kind = vector["message"];
    if (kind == "ATTITUDE") continue;
    INFO(kind << " " << vector["hex"]);
    CHECK(knownCrcExtra(vector["id"]) == vector["extra"].get<std::uint8_t>());
    const Bytes bytes = bytesOf(vector);
    MavlinkParser parser;
    const auto frames = parse(parser, bytes);
    REQUIRE(frames.size() == 1);
    CHECK(frames[0].system == vector["system"]);
    CHECK(frames[0].component == vector["component"]);
    CHECK(frames[0].sequence == vector["sequence"]);
    CHECK(readsAs(kind, vector["values"], frames[0]));
    ++checked;
    if (isReadOnly(kind)) continue;
    MavlinkSender sender = {vector["system"], vector["component"], vector["sequence"]};
    std::array<std::uint8_t, kLongestMavlinkFrame> out = {};
    const std::size_t length = writeFrom(kind, vector["values"], sender, out);
    CHECK(hexOf(std::span(out).first(length)) == vector["hex"].get<std::string>());
  }
  CHECK(checked == 480);
}

TEST_CASE("A message that nobody told of passes from its second frame on", "[mavlink]") {
  MavlinkParser parser;
  std::size_t frames = 0, came = 0;
  const json vectors = protocolVectors("mavlink_vectors.json");
  for (const json& vector : vectors["frames"]) {
    if (vector["message"] != "ATTITUDE") continue;
    CHECK_FALSE(knownCrcExtra(vector["id"]).has_value());
    came += parse(parser, bytesOf(vector)).size();
    ++frames;
  }
  REQUIRE(frames == 20);
  CHECK(came == frames - 1);
}

}  // namespace
}  // namespace swiftlet::test
