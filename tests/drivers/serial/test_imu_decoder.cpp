// What every protocol's decoder owes: round trips, damage, garbage, loss, clocks that wrap, senders that lie.

#include <cmath>
#include <limits>

#include "drivers/device/crc16.hpp"
#include "drivers/mavlink/mavlink_messages.hpp"
#include "drivers/serial/device_count.hpp"
#include "estimator/core/random.hpp"
#include "tests/drivers/serial/decoding.hpp"

namespace swiftlet::test {
namespace {

TEST_CASE("Readings come back as they were sent, with the time of their first byte", "[serial]") {
  for (const ImuProtocol protocol : kProtocols) {
    INFO(name(protocol));
    ImuEncoder encoder(protocol);
    Bytes bytes;
    std::vector<std::size_t> begins;
    constexpr int kCount = 300;
    for (int i = 0; i < kCount; ++i) {
      begins.push_back(bytes.size());
      append(bytes, encoded(encoder, readingNumber(i)));
    }
    Decoded whole;
    for (const std::size_t piece : kPieces) {
      ImuDecoder decoder(protocol);
      const Decoded out = decode(decoder, bytes, piece);
      REQUIRE(out.readings.size() == kCount);
      for (int i = 0; i < kCount; ++i) {
        const auto at = static_cast<std::size_t>(i);
        const ImuReading sent = readingNumber(i);
        const ImuReading& got = out.readings[at];
        CHECK(got.arrival == kFirstByte + Duration{static_cast<std::int64_t>(begins[at]) * kByteTime.ns});
        CHECK(got.device == sent.device);
        CHECK(got.gyro == sent.gyro);
        if (protocol == ImuProtocol::kMip) {
          CHECK((got.accel - sent.accel).norm() < 1e-6);
        } else {
          CHECK(got.accel == sent.accel);
        }
        if (got.counter) CHECK(got.counter == sent.counter);
      }
      const StreamCounters& c = decoder.counters();
      CHECK(c.samples == kCount);
      CHECK(c.skipped_bytes + c.checksum_failures + c.missing_samples + c.clock_steps + c.lost_messages == 0);
      if (piece == 0) whole = out;
      for (std::size_t i = 0; i < out.readings.size(); ++i) CHECK(same(out.readings[i], whole.readings[i]));
    }
  }
}

TEST_CASE("USB CDC: every byte arrives when the read returned", "[serial]") {
  ImuEncoder encoder(ImuProtocol::kBridge);
  Bytes bytes = encoded(encoder, readingNumber(0));
  append(bytes, encoded(encoder, readingNumber(1)));
  ImuDecoder decoder(ImuProtocol::kBridge);
  ImuReading reading;
  // The first read ends within the first frame.
  REQUIRE(decoder.feed(std::span(bytes).first(10), Stamp{100}, Duration{}) == 10);
  CHECK_FALSE(decoder.next(reading));
  REQUIRE(decoder.feed(std::span(bytes).subspan(10), Stamp{200}, Duration{}) == bytes.size() - 10);
  REQUIRE(decoder.next(reading));
  CHECK(reading.arrival == Stamp{100});
  REQUIRE(decoder.next(reading));
  CHECK(reading.arrival == Stamp{200});
}

TEST_CASE("A flipped bit, wherever it is, costs one reading and no other", "[serial]") {
  for (const ImuProtocol protocol : kProtocols) {
    ImuEncoder encoder(protocol);
    const Bytes before = encoded(encoder, readingNumber(1));
    const Bytes hit = encoded(encoder, readingNumber(2));
    Bytes after;
    // As many as a length that was made longer can wait for.
    for (int i = 3; after.size() < 2 * Xsens::kLongestFrame; ++i)
      append(after, encoded(encoder, readingNumber(i)));
    const std::size_t expected = 1 + after.size() / hit.size();
    for (std::size_t bit = 0; bit < 8 * hit.size(); ++bit) {
      INFO(name(protocol) << " bit " << bit);
      Bytes bytes = before;
      append(bytes, hit);
      bytes[before.size() + bit / 8] ^= static_cast<std::uint8_t>(1U << (bit % 8));
      append(bytes, after);
      ImuDecoder decoder(protocol);
      const Decoded out = decode(decoder, bytes);
      REQUIRE(out.readings.size() == expected);
      CHECK(out.readings[1].device == readingNumber(3).device);
      CHECK(decoder.counters().skipped_bytes == hit.size());
    }
  }
}

TEST_CASE("A frame cut at any place costs that reading and no other", "[serial]") {
  for (const ImuProtocol protocol : kProtocols) {
    ImuEncoder encoder(protocol);
    const Bytes cut = encoded(encoder, readingNumber(1));
    Bytes after;
    for (int i = 2; i < 12; ++i) append(after, encoded(encoder, readingNumber(i)));
    for (std::size_t length = 0; length < cut.size(); ++length) {
      INFO(name(protocol) << " cut to " << length);
      Bytes bytes(cut.begin(), cut.begin() + static_cast<std::ptrdiff_t>(length));
      append(bytes, after);
      ImuDecoder decoder(protocol);
      CHECK(decode(decoder, bytes).readings.size() == 10);
    }
  }
}

TEST_CASE("Stray bytes that begin a frame cost no reading", "[serial]") {
  // Not FF for Xsens: whole false headers, which a sum of 8 bits believes once in 256 times.
  const Bytes syncs[] = {{0xFA}, {0xFA}, {0x75, 0x65}, {0xFD, 0xFE}, {0xA9, 0x1C}};
  Random random(15, 1);
  for (std::size_t p = 0; p < std::size(kProtocols); ++p) {
    for (int round = 0; round < 100; ++round) {
      Bytes bytes;
      ImuEncoder encoder(kProtocols[p]);
      constexpr int kCount = 80;
      for (int i = 0; i < kCount; ++i) {
        // Any bytes would do, but for a false header that waits beyond the stream's end.
        if (i < kCount / 4) {
          for (std::uint32_t k = random.below(4); k > 0; --k)
            bytes.push_back(syncs[p][random.below(static_cast<std::uint32_t>(syncs[p].size()))]);
        }
        append(bytes, encoded(encoder, readingNumber(i)));
      }
      INFO(name(kProtocols[p]) << " round " << round);
      ImuDecoder decoder(kProtocols[p]);
      CHECK(decode(decoder, bytes, 1 + random.below(100)).readings.size() == kCount);
    }
  }
}

TEST_CASE("Readings that were lost on the way are counted from the sensor's counter or clock", "[serial]") {
  for (const ImuProtocol protocol : kProtocols) {
    INFO(name(protocol));
    ImuEncoder encoder(protocol);
    Bytes bytes;
    for (int i = 0; i < 400; ++i) {
      const Bytes frame = encoded(encoder, readingNumber(i));
      const bool lost = i == 50 || (i > 100 && i <= 107) || i % 90 == 89;
      if (!lost) append(bytes, frame);
    }
    ImuDecoder decoder(protocol);
    (void)decode(decoder, bytes);
    CHECK(decoder.counters().missing_samples == 12);
    CHECK(decoder.counters().lost_messages == (protocol == ImuProtocol::kMavlink ? 12 : 0));
  }
}

TEST_CASE("Clocks and counters of 16 and 32 bits go on over their end", "[serial]") {
  ImuEncoder encoder(ImuProtocol::kXsens);
  Bytes bytes;
  constexpr std::int64_t kTick = 100'000;
  constexpr std::int64_t kWrap = std::int64_t{1} << 32;
  for (int i = 0; i < 40; ++i) {
    ImuReading reading = readingNumber(i);
    reading.device = Stamp{(kWrap - 500 + 25 * i) * kTick};
    reading.counter = 65530 + static_cast<std::uint64_t>(i);
    append(bytes, encoded(encoder, reading));
  }
  ImuDecoder decoder(ImuProtocol::kXsens);
  const Decoded out = decode(decoder, bytes);
  REQUIRE(out.readings.size() == 40);
  CHECK(out.readings[39].device->ns == (kWrap - 500 + 25 * 39) * kTick);
  CHECK(*out.readings[39].counter == 65569);
  CHECK(decoder.counters().clock_steps == 0);
  CHECK(decoder.counters().missing_samples == 0);
}

TEST_CASE("A sensor that starts again shows as a step back", "[serial]") {
  for (const ImuProtocol protocol : kProtocols) {
    INFO(name(protocol));
    ImuEncoder encoder(protocol);
    Bytes bytes;
    for (int i = 100; i < 150; ++i) append(bytes, encoded(encoder, readingNumber(i)));
    for (int i = 0; i < 50; ++i) append(bytes, encoded(encoder, readingNumber(i)));
    ImuDecoder decoder(protocol);
    const Decoded out = decode(decoder, bytes);
    REQUIRE(out.readings.size() == 100);
    CHECK(decoder.counters().clock_steps == 1);
    CHECK(decoder.counters().missing_samples == 0);
    CHECK(*out.readings[50].device < *out.readings[49].device);
  }
}

TEST_CASE("Readings that are not finite are dropped and counted", "[serial]") {
  for (const ImuProtocol protocol : kProtocols) {
    INFO(name(protocol));
    ImuEncoder encoder(protocol);
    ImuReading nan = readingNumber(1), infinite = readingNumber(2);
    nan.gyro.y() = std::numeric_limits<double>::quiet_NaN();
    infinite.accel.z() = -std::numeric_limits<double>::infinity();
    Bytes bytes = encoded(encoder, readingNumber(0));
    append(bytes, encoded(encoder, nan));
    append(bytes, encoded(encoder, infinite));
    append(bytes, encoded(encoder, readingNumber(3)));
    ImuDecoder decoder(protocol);
    CHECK(decode(decoder, bytes).readings.size() == 2);
    CHECK(decoder.counters().not_finite == 2);
  }
}

TEST_CASE("MAVLink: one sender, one sensor, and only what is fresh", "[serial]") {
  std::array<std::uint8_t, kLongestMavlinkFrame> out = {};
  Bytes bytes;
  const auto add = [&](MavlinkSender sender, std::uint16_t fields, std::uint8_t sensor) {
    mavlink::HighresImu imu;
    imu.time_usec = 1000;
    imu.accel = {0, 0, -9.75F};
    imu.fields_updated = fields;
    imu.id = sensor;
    const std::size_t length = mavlink::write(sender, imu, out);
    append(bytes, std::span(out).first(length));
  };
  const MavlinkSender autopilot = {1, 1, 0}, camera = {1, 100, 0}, other = {2, 1, 0};
  add(camera, 0x07, 0);     // no rates: does not choose
  add(autopilot, 0x3F, 0);  // chooses
  add(camera, 0x3F, 0);
  add(other, 0x3F, 0);
  add(autopilot, 0x3F, 1);
  add(autopilot, 0x1F, 0);
  add(autopilot, 0x1FFF, 0);
  ImuDecoder decoder(ImuProtocol::kMavlink);
  CHECK(decode(decoder, bytes).readings.size() == 2);
  CHECK(decoder.counters().without_sample == 5);
  CHECK(decoder.mavlinkSource() == MavlinkImuSource{1, 1, 0});
}

TEST_CASE("MAVLink: RAW_IMU and SCALED_IMU are read where they are asked for, and then alone", "[serial]") {
  // Of node-mavlink's frames.
  const nlohmann::json vectors = protocolVectors("mavlink_vectors.json");
  Bytes bytes;
  std::size_t scaled = 0, raw = 0;
  nlohmann::json first_raw;
  for (const nlohmann::json& vector : vectors["frames"]) {
    const std::string kind = vector["message"];
    // One sender's frames are enough: each is another's.
    if (kind == "SCALED_IMU" && scaled++ == 0) append(bytes, bytesOf(vector));
    if (kind == "RAW_IMU" && raw++ == 0) {
      append(bytes, bytesOf(vector));
      first_raw = vector["values"];
    }
  }
  REQUIRE(scaled > 0);
  REQUIRE(raw > 0);
  ImuDecoder usual(ImuProtocol::kMavlink);
  CHECK(decode(usual, bytes).readings.empty());
  ImuDecoder decoder(ImuProtocol::kMavlink);
  decoder.takeMavlink(mavlink::ScaledImu::kRawId);
  const Decoded got = decode(decoder, bytes);
  REQUIRE(got.readings.size() == 1);
  CHECK(got.readings[0].device->ns == 1000 * first_raw["time_usec"].get<std::int64_t>());
  for (int i = 0; i < 3; ++i) {
    const auto axis = static_cast<std::size_t>(i);
    CHECK(got.readings[0].accel[i] == Approx(first_raw["acc"][axis].get<double>() * 9.80665e-3));
    CHECK(got.readings[0].gyro[i] == Approx(first_raw["gyro"][axis].get<double>() * 1e-3));
  }
  CHECK(got.readings[0].mean_age == Duration{});
  decoder.takeMavlink(mavlink::ScaledImu::kScaledId);
  CHECK(decode(decoder, bytes).readings.size() == 1);
}

TEST_CASE("MAVLink: PX4's means are half an interval old, 2.5 ms at most", "[serial]") {
  struct Case {
    std::uint8_t autopilot;
    std::int64_t step_us;
    std::int64_t age_us;
  };
  constexpr std::uint8_t kArduPilot = 3;
  for (const Case& one : {Case{mavlink::Heartbeat::kPx4, 20'000, 2500},
                          {mavlink::Heartbeat::kPx4, 5'000, 2500},
                          {mavlink::Heartbeat::kPx4, 2'500, 1250},
                          {kArduPilot, 5'000, 0}}) {
    INFO(one.step_us);
    std::array<std::uint8_t, kLongestMavlinkFrame> out = {};
    MavlinkSender sender = {1, 1, 0};
    mavlink::Heartbeat beat;
    beat.autopilot = one.autopilot;
    Bytes bytes;
    append(bytes, std::span(out).first(mavlink::write(sender, beat, out)));
    for (std::int64_t i = 1; i <= 20; ++i) {
      mavlink::HighresImu imu;
      imu.time_usec = static_cast<std::uint64_t>(1'000'000 + i * one.step_us);
      imu.fields_updated = 0x3F;
      append(bytes, std::span(out).first(mavlink::write(sender, imu, out)));
    }
    ImuDecoder decoder(ImuProtocol::kMavlink);
    const Decoded got = decode(decoder, bytes);
    REQUIRE(got.readings.size() == 20);
    CHECK(got.readings.back().mean_age.ns == 1000 * one.age_us);
    CHECK(got.readings.back().device == Stamp{1000 * (1'000'000 + 20 * one.step_us)});
    if (one.autopilot == mavlink::Heartbeat::kPx4) CHECK(got.readings.front().mean_age.ns == 2'500'000);
  }
}

TEST_CASE("MAVLink: TIMESYNC and camera triggers come out beside the readings", "[serial]") {
  std::array<std::uint8_t, kLongestMavlinkFrame> out = {};
  MavlinkSender sender = {1, 1, 0};
  mavlink::CameraTrigger trigger;
  trigger.time_usec = 2'000'000;
  trigger.seq = 41;
  const std::size_t length = mavlink::write(sender, trigger, out);
  Bytes bytes(out.begin(), out.begin() + static_cast<std::ptrdiff_t>(length));
  append(bytes, bytesOf(named(protocolVectors("mavlink.json"), "ml2_timesync_response")));
  ImuDecoder decoder(ImuProtocol::kMavlink);
  const Decoded got = decode(decoder, bytes);
  REQUIRE(got.edges.size() == 1);
  CHECK(got.edges[0].device == Stamp{2'000'000'000});
  CHECK(got.edges[0].counter == 41);
  REQUIRE(got.heard.size() == 1);
  CHECK(std::get<mavlink::Timesync>(got.heard[0].message).tc1 == 98765432100000);
  CHECK(got.heard[0].system == 1);
  CHECK(got.heard[0].arrival > got.edges[0].arrival);
}

TEST_CASE("VectorNav: an edge is told of once, however many samples repeat it", "[serial]") {
  const Bytes frame = bytesOf(named(protocolVectors("vectornav.json"), "vn_common_sync_plus_imu_group"));
  Bytes bytes = frame;
  append(bytes, frame);
  ImuDecoder decoder(ImuProtocol::kVectorNav);
  const Decoded out = decode(decoder, bytes);
  CHECK(out.readings.size() == 2);
  REQUIRE(out.edges.size() == 1);
  CHECK(out.edges[0].device.ns == 5'000'000'000 - 1'250'000);
}

TEST_CASE("Edges that nobody takes are refused, not overwritten, and counted", "[serial]") {
  ImuDecoder decoder(ImuProtocol::kBridge);
  std::array<std::uint8_t, 64> out = {};
  ImuReading reading;
  for (std::uint64_t i = 0; i < ImuDecoder::kMostEvents + 10; ++i) {
    TriggerEdge edge;
    edge.counter = i;
    const std::size_t length = encodeBridge(edge, out);
    REQUIRE(decoder.feed(std::span(out).first(length), Stamp{}, Duration{}) == length);
    CHECK_FALSE(decoder.next(reading));
  }
  CHECK(decoder.counters().edges == ImuDecoder::kMostEvents);
  CHECK(decoder.counters().events_refused == 10);
  TriggerEdge first;
  REQUIRE(decoder.nextEdge(first));
  CHECK(first.counter == 0);
}

TEST_CASE("Newer bridges may send more, other kinds and versions pass by", "[serial]") {
  ImuReading reading = readingNumber(7);
  std::array<std::uint8_t, 64> out = {};
  Bytes bytes;
  const auto add = [&](std::uint8_t kind, std::size_t length) {
    // The checksum is made anew over the changed head.
    const std::size_t whole = encodeBridge(reading, 36.5F, out);
    REQUIRE(whole == 46);
    out[2] = kind;
    out[3] = static_cast<std::uint8_t>(length);
    const std::uint16_t crc = crc16Ccitt(0xFFFF, std::span(out).subspan(2, 2 + length));
    append(bytes, std::span(out).first(4 + length));
    bytes.push_back(static_cast<std::uint8_t>(crc & 0xFFU));
    bytes.push_back(static_cast<std::uint8_t>(crc >> 8U));
  };
  add(0x11, 36);
  add(0x11, 40);
  add(0x11, 35);  // too short for a sample
  add(0x13, 12);
  add(0x21, 36);
  ImuDecoder decoder(ImuProtocol::kBridge);
  CHECK(decode(decoder, bytes).readings.size() == 2);
  CHECK(decoder.counters().unknown_kinds == 3);
}

TEST_CASE("After a restart half a frame is forgotten and clocks begin anew", "[serial]") {
  ImuEncoder encoder(ImuProtocol::kBridge);
  const Bytes first = encoded(encoder, readingNumber(1000)), second = encoded(encoder, readingNumber(3));
  ImuDecoder decoder(ImuProtocol::kBridge);
  Bytes bytes = first;
  append(bytes, std::span(first).first(20));
  CHECK(decode(decoder, bytes).readings.size() == 1);
  decoder.restart();
  CHECK(decoder.waiting() == 0);
  const Decoded out = decode(decoder, second);
  REQUIRE(out.readings.size() == 1);
  CHECK(*out.readings[0].counter == 3);
  CHECK(decoder.counters().clock_steps == 0);
  CHECK(decoder.counters().skipped_bytes == 20);
}

TEST_CASE("A gap of hours between readings is an interruption, not lost samples", "[serial]") {
  SampleGaps gaps;
  for (std::int64_t i = 0; i < 20; ++i) CHECK(gaps.step(Stamp{i * 5'000'000}, {}).missing == 0);
  CHECK(gaps.step(Stamp{19 * 5'000'000 + 21'000'000}, {}).missing == 3);
  CHECK(gaps.step(Stamp{3'600'000'000'000}, {}).missing == 0);
}

TEST_CASE("Protocols go by the names that settings give them", "[serial]") {
  for (const ImuProtocol protocol : kProtocols) CHECK(imuProtocol(name(protocol)) == protocol);
  CHECK_FALSE(imuProtocol("nmea").has_value());
}

TEST_CASE("Encoders that lack room write nothing", "[serial]") {
  for (const ImuProtocol protocol : kProtocols) {
    std::array<std::uint8_t, ImuEncoder::kLongestFrame> out = {};
    ImuEncoder encoder(protocol);
    const std::size_t length = encoder.encode(readingNumber(1), out);
    for (std::size_t size = 0; size < length; ++size)
      CHECK(encoder.encode(readingNumber(1), std::span(out).first(size)) == 0);
  }
}

}  // namespace
}  // namespace swiftlet::test
