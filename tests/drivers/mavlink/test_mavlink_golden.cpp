// MAVLink frames whose meaning other implementations agree on.

#include "drivers/device/byte_fields.hpp"
#include "drivers/device/crc16.hpp"
#include "tests/drivers/mavlink/mavlink_json.hpp"

namespace swiftlet::test {
namespace {

TEST_CASE("CRC-16 gives its catalogue's check values", "[mavlink]") {
  const std::string text = "123456789";
  const Bytes bytes(text.begin(), text.end());
  CHECK(crc16Ccitt(0, bytes) == 0x31C3);
  CHECK(crc16Ccitt(0xFFFF, bytes) == 0x29B1);
  CHECK(crc16Mcrf4xx(0xFFFF, bytes) == 0x6F91);
}

TEST_CASE("Every golden MAVLink frame is read as expected", "[mavlink]") {
  const auto vectors = protocolVectors("mavlink.json");
  REQUIRE(vectors["frames"].size() == 13);
  for (const auto& golden : vectors["frames"]) {
    INFO(golden["name"]);
    const Bytes bytes = bytesOf(golden);
    MavlinkParser parser;
    const auto frames = parse(parser, bytes);
    if (!golden["valid"]) {
      CHECK(frames.empty());
      CHECK(parser.counters().checksum_failures + parser.counters().unknown_flags >= 1);
      continue;
    }
    REQUIRE(frames.size() == 1);
    const MavlinkFrame& frame = frames[0];
    CHECK(frame.message == golden["msgid"].get<std::uint32_t>());
    CHECK(parser.counters().skipped_bytes == 0);
    mavlink::HighresImu imu;
    mavlink::Timesync timesync;
    MavlinkSender sender = {frame.system, frame.component, frame.sequence};
    std::array<std::uint8_t, kLongestMavlinkFrame> out = {};
    std::size_t written = 0;
    if (mavlink::read(frame, imu)) {
      CHECK(same(imu, highresImuOf(golden["values"])));
      written = mavlink::write(sender, imu, out);
    } else if (mavlink::read(frame, timesync)) {
      CHECK(same(timesync, timesyncOf(golden["values"])));
      written = mavlink::write(sender, timesync, out);
    } else {
      // Messages that are carried but not read: what came in goes out the same.
      const std::size_t length = frame.length;
      written = packMavlink(sender, frame.message, *knownCrcExtra(frame.message),
                            std::span(frame.payload).first(length), out);
    }
    if (frame.version == 2 && !frame.is_signed) {
      CHECK(hexOf(std::span(out).first(written)) == golden["hex"].get<std::string>());
      CHECK(sender.sequence == static_cast<std::uint8_t>(frame.sequence + 1));
    }
  }
}

TEST_CASE("The fields of golden frames that others will read lie where they should", "[mavlink]") {
  const auto golden = protocolVectors("mavlink.json");
  MavlinkParser parser;
  const auto scaled = parse(parser, bytesOf(named(golden, "ml2_scaled_imu")));
  LittleFieldReader from(scaled.at(0).payload);
  CHECK(from.u32() == 123456);
  CHECK(from.i16() == 12);
  CHECK(from.i16() == -34);
  CHECK(from.i16() == -1001);
  const auto odometry = parse(parser, bytesOf(named(golden, "ml2_odometry")));
  LittleFieldReader pose(odometry.at(0).payload);
  CHECK(pose.u64() == 987654321);
  CHECK(pose.vectorF32() == Eigen::Vector3d(1.5, -2.25, -0.75));
}

TEST_CASE("Golden MAVLink streams give their frames in any pieces", "[mavlink]") {
  const auto golden = protocolVectors("mavlink.json");
  for (const auto& stream : golden["streams"]) {
    StreamCounters first;
    for (const std::size_t piece : kPieces) {
      INFO(stream["name"] << " in pieces of " << piece);
      MavlinkParser parser;
      const auto frames = parse(parser, bytesOf(stream), piece);
      REQUIRE(frames.size() == stream["expect"].size());
      for (std::size_t i = 0; i < frames.size(); ++i) {
        const Bytes bytes = bytesOf(named(golden, stream["expect"][i]));
        MavlinkParser alone;
        const auto expected = parse(alone, bytes);
        CHECK(frames[i].message == expected.at(0).message);
        CHECK(frames[i].sequence == expected.at(0).sequence);
        CHECK(frames[i].payload == expected.at(0).payload);
      }
      if (piece == 0) first = parser.counters();
      CHECK(parser.counters() == first);
    }
  }
}

TEST_CASE("The frames that others gave for a command and a heartbeat are written", "[mavlink]") {
  std::array<std::uint8_t, kLongestMavlinkFrame> out = {};
  MavlinkSender sender = {1, 191, 0};
  mavlink::CommandLong command;
  command.command = mavlink::CommandLong::kSetMessageInterval;
  command.param[0] = 105;
  command.param[1] = 4000;
  std::size_t length = mavlink::write(sender, command, out);
  CHECK(hexOf(std::span(out).first(length)) ==
        "fd2000000001bf4c00000000d24200007a450000000000000000000000000000000000000000ff0101012e33");
  MavlinkSender companion;
  length = mavlink::write(companion, mavlink::Heartbeat{}, out);
  CHECK(hexOf(std::span(out).first(length)) == "fd0900000001c50000000000000012080004031ee4");
}

}  // namespace
}  // namespace swiftlet::test
