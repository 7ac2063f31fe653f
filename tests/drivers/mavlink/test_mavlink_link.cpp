// What a link does to frames: loss, damage, other senders, frames that pretend.

#include "estimator/core/random.hpp"
#include "tests/drivers/mavlink/mavlink_json.hpp"

namespace swiftlet::test {
namespace {

Bytes imuFrame(MavlinkSender& sender, std::uint64_t time_usec) {
  mavlink::HighresImu imu;
  imu.time_usec = time_usec;
  imu.accel = {0.25F, -0.5F, -9.8125F};
  imu.gyro = {0.5F, 0.25F, 0.125F};
  imu.fields_updated = 0x3F;
  std::array<std::uint8_t, kLongestMavlinkFrame> out = {};
  const std::size_t length = mavlink::write(sender, imu, out);
  REQUIRE(length > 0);
  return {out.begin(), out.begin() + static_cast<std::ptrdiff_t>(length)};
}

TEST_CASE("No bit of a MAVLink frame can be wrong", "[mavlink]") {
  MavlinkSender sender;
  const Bytes good = imuFrame(sender, 123456);
  const Bytes next = imuFrame(sender, 127456);
  for (std::size_t bit = 0; bit < 8 * good.size(); ++bit) {
    INFO("bit " << bit);
    Bytes bytes = good;
    bytes[bit / 8] ^= static_cast<std::uint8_t>(1U << (bit % 8));
    append(bytes, next);
    // A length or an identifier that was made greater waits for what comes after.
    for (int i = 0; i < 6; ++i) append(bytes, next);
    MavlinkParser parser;
    const auto frames = parse(parser, bytes);
    REQUIRE(frames.size() == 7);
    for (const MavlinkFrame& frame : frames) CHECK(frame.sequence == 1);
  }
}

TEST_CASE("Lost messages are counted for each sender by itself", "[mavlink]") {
  MavlinkParser parser;
  MavlinkSender autopilot = {1, 1, 250};
  MavlinkSender camera = {1, 100, 7};
  Bytes bytes;
  for (std::uint64_t i = 0; i < 20; ++i) {
    const Bytes a = imuFrame(autopilot, i), b = imuFrame(camera, i);
    if (i != 3 && i != 9 && i != 10) append(bytes, a);
    if (i != 5) append(bytes, b);
  }
  CHECK(parse(parser, bytes).size() == 36);
  CHECK(parser.counters().lost_messages == 4);
  // Pulled out and plugged in again, what was sent in between is not loss.
  autopilot.sequence = static_cast<std::uint8_t>(autopilot.sequence + 100);
  parser.restart();
  CHECK(parse(parser, imuFrame(autopilot, 0)).size() == 1);
  CHECK(parser.counters().lost_messages == 4);
}

TEST_CASE("A signature is passed over and counted, unknown flags refuse", "[mavlink]") {
  const auto golden = protocolVectors("mavlink.json");
  MavlinkParser parser;
  const auto frames = parse(parser, bytesOf(named(golden, "ml2_signed_highres_imu")));
  REQUIRE(frames.size() == 1);
  CHECK(frames[0].is_signed);
  CHECK(parser.counters().signed_messages == 1);
  CHECK(parse(parser, bytesOf(named(golden, "ml2_unknown_incompat"))).empty());
  CHECK(parser.counters().unknown_flags == 1);
}

TEST_CASE("Good frames are found again after any garbage", "[mavlink]") {
  Random random(15, 4);
  for (int round = 0; round < 300; ++round) {
    Bytes bytes(random.below(400));
    for (std::uint8_t& byte : bytes) {
      // Every fourth byte pretends to begin a frame.
      byte = static_cast<std::uint8_t>(random.below(4) == 0 ? 0xFD + random.below(2) : random.below(256));
    }
    MavlinkSender sender;
    for (std::uint64_t i = 0; i < 8; ++i) append(bytes, imuFrame(sender, i));
    MavlinkParser parser;
    const auto frames = parse(parser, bytes, 1 + random.below(90));
    REQUIRE(frames.size() == 8);
    CHECK(frames.front().sequence == 0);
    const StreamCounters& c = parser.counters();
    CHECK(c.bytes == c.framed_bytes + c.skipped_bytes + parser.waiting());
  }
}

TEST_CASE("A frame of version 1 and one of full length are read", "[mavlink]") {
  const auto golden = protocolVectors("mavlink.json");
  MavlinkParser parser;
  const auto frames = parse(parser, bytesOf(named(golden, "ml1_highres_imu")));
  REQUIRE(frames.size() == 1);
  CHECK(frames[0].version == 1);
  CHECK(frames[0].system == 1);
  std::array<std::uint8_t, kLongestMavlinkPayload> payload = {};
  payload.fill(0xFD);
  std::array<std::uint8_t, kLongestMavlinkFrame> out = {};
  MavlinkSender sender;
  const std::size_t length = packMavlink(sender, 331, 91, payload, out);
  CHECK(length == 267);
  // Longer than the message is known to be: newer senders add fields.
  const auto longest = parse(parser, Bytes(out.begin(), out.begin() + static_cast<std::ptrdiff_t>(length)));
  REQUIRE(longest.size() == 1);
  CHECK(longest[0].payload == payload);
}

TEST_CASE("What does not fit is not written and costs no sequence number", "[mavlink]") {
  MavlinkSender sender;
  std::array<std::uint8_t, kLongestMavlinkFrame> out = {};
  const std::size_t length = mavlink::write(sender, mavlink::Heartbeat{}, out);
  CHECK(sender.sequence == 1);
  for (std::size_t size = 0; size < length; ++size) {
    CHECK(mavlink::write(sender, mavlink::Heartbeat{}, std::span(out).first(size)) == 0);
  }
  CHECK(sender.sequence == 1);
}

}  // namespace
}  // namespace swiftlet::test
