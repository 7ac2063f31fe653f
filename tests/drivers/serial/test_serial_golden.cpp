// Frames of VectorNav, Xsens and MicroStrain sensors whose meaning their makers' software agrees on.

#include <cmath>
#include <numbers>

#include "tests/drivers/serial/decoding.hpp"

namespace swiftlet::test {
namespace {

using nlohmann::json;

constexpr double kGravity = 9.80665;

Eigen::Vector3d vectorOf(const json& v) {
  return {v[0].get<double>(), v[1].get<double>(), v[2].get<double>()};
}

struct Expected {
  bool sample = false;
  Eigen::Vector3d gyro, accel;
  std::optional<std::int64_t> device;
  std::optional<std::uint64_t> counter;
  std::optional<std::int64_t> edge;
};

Expected expectedOf(ImuProtocol protocol, const json& v) {
  Expected e;
  const auto take = [&](const char* gyro, const char* accel, double gyro_unit, double accel_unit) {
    if (e.sample || !v.contains(gyro) || !v.contains(accel)) return;
    e.sample = true;
    e.gyro = vectorOf(v[gyro]) * gyro_unit;
    e.accel = vectorOf(v[accel]) * accel_unit;
  };
  if (protocol == ImuProtocol::kVectorNav) {
    take("uncomp_gyro", "uncomp_accel", 1, 1);
    take("angular_rate", "accel", 1, 1);
    if (v.contains("delta_time_s")) {
      const double dt = v["delta_time_s"];
      take("delta_theta_deg", "delta_velocity", std::numbers::pi / 180 / dt, 1 / dt);
    }
    if (v.contains("time_startup_ns")) e.device = v["time_startup_ns"];
    if (v.contains("time_sync_in_ns")) e.edge = *e.device - v["time_sync_in_ns"].get<std::int64_t>();
  }
  if (protocol == ImuProtocol::kXsens) {
    take("rate_of_turn", "accel", 1, 1);
    take("rate_of_turn_hr", "accel_hr", 1, 1);
    if (v.contains("sample_time_fine")) e.device = v["sample_time_fine"].get<std::int64_t>() * 100'000;
    if (v.contains("packet_counter")) e.counter = v["packet_counter"];
    if (v.contains("trigger1")) e.edge = v["trigger1"]["timestamp"].get<std::int64_t>() * 100'000;
  }
  if (protocol == ImuProtocol::kMip) {
    take("gyro", "accel_g", 1, kGravity);
    if (v.contains("reference_delta_ns")) {
      const double dt = v["reference_delta_ns"].get<double>() * 1e-9;
      take("delta_theta_rad", "delta_velocity_g_s", 1 / dt, kGravity / dt);
    }
    if (v.contains("reference_time_ns")) {
      e.device = v["reference_time_ns"];
    } else if (v.contains("gps_tow_s")) {
      e.device = v["gps_week"].get<std::int64_t>() * 604'800'000'000'000 +
                 std::llround(v["gps_tow_s"].get<double>() * 1e9);
    } else if (v.contains("external_time_ns")) {
      e.device = v["external_time_ns"];
    }
  }
  return e;
}

void check(const Expected& expected, const ImuReading& reading) {
  // One rounding apart at most: degrees and g are converted by one product and one quotient.
  CHECK((reading.gyro - expected.gyro).norm() <= 1e-15 * expected.gyro.norm());
  CHECK((reading.accel - expected.accel).norm() <= 1e-15 * expected.accel.norm());
  REQUIRE(reading.device.has_value());
  CHECK(reading.device->ns == *expected.device);
}

struct File {
  ImuProtocol protocol;
  const char* name;
};
constexpr File kFiles[] = {{ImuProtocol::kVectorNav, "vectornav.json"},
                           {ImuProtocol::kXsens, "xsens.json"},
                           {ImuProtocol::kMip, "mip.json"}};

TEST_CASE("Every golden frame of a serial sensor is read as expected", "[serial]") {
  for (const File& file : kFiles) {
    const json vectors = protocolVectors(file.name);
    REQUIRE(vectors["frames"].size() >= 5);
    for (const json& golden : vectors["frames"]) {
      INFO(golden["name"]);
      ImuDecoder decoder(file.protocol);
      const Decoded out = decode(decoder, bytesOf(golden));
      const StreamCounters& c = decoder.counters();
      if (!golden["valid"]) {
        CHECK(out.readings.empty());
        CHECK(c.checksum_failures == 1);
        continue;
      }
      CHECK(c.frames == 1);
      CHECK(c.skipped_bytes == 0);
      const Expected expected = expectedOf(file.protocol, golden["values"]);
      REQUIRE(out.readings.size() == (expected.sample ? 1U : 0U));
      CHECK(c.without_sample == (expected.sample ? 0U : 1U));
      if (!expected.sample) continue;
      check(expected, out.readings[0]);
      CHECK(out.readings[0].counter == expected.counter);
      CHECK(out.readings[0].arrival == kFirstByte);
      REQUIRE(out.edges.size() == (expected.edge ? 1U : 0U));
      if (!expected.edge) continue;
      CHECK(out.edges[0].device.ns == *expected.edge);
      CHECK(out.edges[0].counter == 77);
    }
  }
}

TEST_CASE("Golden streams of serial sensors give their frames in any pieces", "[serial]") {
  for (const File& file : kFiles) {
    const json vectors = protocolVectors(file.name);
    for (const json& stream : vectors["streams"]) {
      Decoded first;
      StreamCounters counters;
      for (const std::size_t piece : kPieces) {
        INFO(stream["name"] << " in pieces of " << piece);
        ImuDecoder decoder(file.protocol);
        const Decoded out = decode(decoder, bytesOf(stream), piece);
        CHECK(decoder.counters().frames == stream["expect"].size());
        std::size_t i = 0;
        for (const json& name : stream["expect"]) {
          const Expected expected = expectedOf(file.protocol, named(vectors, name)["values"]);
          if (!expected.sample) continue;
          REQUIRE(i < out.readings.size());
          CHECK((out.readings[i].gyro - expected.gyro).norm() <= 1e-15 * expected.gyro.norm());
          CHECK((out.readings[i].accel - expected.accel).norm() <= 1e-15 * expected.accel.norm());
          ++i;
        }
        CHECK(i == out.readings.size());
        if (piece == 0) {
          first = out;
          counters = decoder.counters();
        }
        CHECK(decoder.counters() == counters);
        REQUIRE(out.readings.size() == first.readings.size());
        for (i = 0; i < out.readings.size(); ++i) CHECK(same(out.readings[i], first.readings[i]));
        CHECK(out.edges == first.edges);
      }
    }
  }
}

TEST_CASE("Encoders give the golden frames' bytes", "[serial]") {
  std::array<std::uint8_t, 100> out = {};
  ImuReading reading;
  const json vn = named(protocolVectors("vectornav.json"), "vn_common_time_imu");
  reading.device = Stamp{vn["values"]["time_startup_ns"].get<std::int64_t>()};
  reading.gyro = vectorOf(vn["values"]["uncomp_gyro"]);
  reading.accel = vectorOf(vn["values"]["uncomp_accel"]);
  CHECK(hexOf(std::span(out).first(encodeVectorNav(reading, out))) == vn["hex"].get<std::string>());

  const json xs = named(protocolVectors("xsens.json"), "xs_float32");
  reading.device = Stamp{xs["values"]["sample_time_fine"].get<std::int64_t>() * 100'000};
  reading.counter = xs["values"]["packet_counter"].get<std::uint64_t>();
  reading.gyro = vectorOf(xs["values"]["rate_of_turn"]);
  reading.accel = vectorOf(xs["values"]["accel"]);
  CHECK(hexOf(std::span(out).first(encodeXsens(reading, out))) == xs["hex"].get<std::string>());

  // The golden MIP frame has another clock than encodeMip sends: its fields one by one.
  const json mip = named(protocolVectors("mip.json"), "mip_accel_gyro_gps");
  const Bytes bytes = bytesOf(mip);
  MipWriter packet(out, 0x80);
  packet.field(0x04, std::span(bytes).subspan(6, 12));
  packet.field(0x05, std::span(bytes).subspan(20, 12));
  packet.field(0xD3, std::span(bytes).subspan(34, 12));
  CHECK(hexOf(std::span(out).first(packet.finish())) == mip["hex"].get<std::string>());
}

TEST_CASE("A bridge's frames are these bytes", "[serial]") {
  // Written down by an implementation apart from this one (Python's struct and a bitwise CRC).
  const Bytes sample = bytesOf(
      {{"hex", "a91c112400ca9a3b00000000feffffff0000003e000080be0000003f0000803f0000004000001dc1d387"}});
  const Bytes edge = bytesOf({{"hex", "a91c120e400caa3b000000004d00000001013c26"}});
  Bytes both = sample;
  append(both, edge);
  ImuDecoder decoder(ImuProtocol::kBridge);
  const Decoded out = decode(decoder, both);
  REQUIRE(out.readings.size() == 1);
  CHECK(out.readings[0].device->ns == 1'000'000'000);
  CHECK(*out.readings[0].counter == 0xFFFFFFFEU);
  CHECK(out.readings[0].gyro == Eigen::Vector3d(0.125, -0.25, 0.5));
  CHECK(out.readings[0].accel == Eigen::Vector3d(1, 2, -9.8125));
  REQUIRE(out.edges.size() == 1);
  CHECK(out.edges[0] ==
        TriggerEdge{kFirstByte + Duration{42 * kByteTime.ns}, Stamp{1'001'000'000}, 77, 1, true});
  std::array<std::uint8_t, 64> written = {};
  CHECK(hexOf(std::span(written).first(encodeBridge(out.readings[0], {}, written))) == hexOf(sample));
  CHECK(hexOf(std::span(written).first(encodeBridge(out.edges[0], written))) == hexOf(edge));
}

}  // namespace
}  // namespace swiftlet::test
