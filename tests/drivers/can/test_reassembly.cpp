#include <catch2/catch.hpp>
#include <limits>

#include <array>
#include <vector>

#include "drivers/can/raw_imu.hpp"
#include "estimator/core/random.hpp"
#include "tests/drivers/can/flight.hpp"

namespace swiftlet {
namespace {

constexpr std::uint8_t kNode = 42;

std::vector<ImuReading> readingsOf(RawImuDecoder& decoder, const std::vector<CanFrame>& frames) {
  std::vector<ImuReading> out;
  ImuReading reading;
  for (const CanFrame& frame : frames) {
    if (decoder.take(frame, reading)) out.push_back(reading);
  }
  return out;
}

void append(std::vector<CanFrame>& all, const DroneCanFrames& frames) {
  for (std::size_t i = 0; i < frames.count; ++i) {
    all.push_back(frames.frames[i]);
    all.back().arrival = Stamp{static_cast<std::int64_t>(all.size()) * 300'000};
  }
}

TEST_CASE("Every transfer of every kind and length comes back as it was", "[can]") {
  for (const bool fd : {false, true}) {
    for (std::size_t terms = 0; terms <= 36; ++terms) {
      std::vector<CanFrame> frames;
      for (std::uint64_t i = 0; i < 70; ++i) append(frames, canflight::frames(i, kNode, fd, terms));
      RawImuDecoder decoder;
      const std::vector<ImuReading> readings = readingsOf(decoder, frames);
      INFO((fd ? "FD, " : "classic, ") << terms << " terms");
      REQUIRE(readings.size() == 70);
      for (std::size_t i = 0; i < 70; ++i) {
        REQUIRE(canflight::numberOf(readings[i]) == static_cast<std::int64_t>(i));
        REQUIRE(readings[i].counter == i);
      }
      CHECK(decoder.transfers().lost == 0);
      CHECK(decoder.transfers().broken == 0);
      CHECK(decoder.node() == kNode);
    }
  }
}

TEST_CASE("Frames lost, repeated and damaged at random never make a reading that was not sent", "[can]") {
  Random random(11, 0);
  std::size_t delivered = 0;
  std::size_t possible = 0;
  for (int run = 0; run < 300; ++run) {
    const bool fd = run % 3 == 0;
    std::vector<CanFrame> sent;
    // Two nodes, their frames in turn.
    for (std::uint64_t i = 0; i < 40; ++i) {
      const DroneCanFrames a = canflight::frames(i, kNode, fd, run % 2 == 0 ? 0 : 30);
      const DroneCanFrames b = canflight::frames(i + 1000, kNode + 1, fd, run % 2 == 0 ? 0 : 30);
      for (std::size_t k = 0; k < a.count; ++k) {
        sent.push_back(a.frames[k]);
        sent.push_back(b.frames[k]);
      }
    }
    std::vector<CanFrame> heard;
    for (const CanFrame& frame : sent) {
      const std::uint32_t fate = random.below(100);
      if (fate < 3) continue;
      heard.push_back(frame);
      if (fate < 6) heard.push_back(frame);
      if (fate >= 6 && fate < 8) {
        CanFrame& damaged = heard.back();
        damaged.data[random.below(damaged.size)] ^= static_cast<std::uint8_t>(1U << random.below(8));
      }
      heard.back().arrival = Stamp{static_cast<std::int64_t>(heard.size()) * 100'000};
    }
    RawImuDecoder decoder(kNode);
    std::int64_t newest = -1;
    for (const ImuReading& reading : readingsOf(decoder, heard)) {
      const std::int64_t number = canflight::numberOf(reading);
      // A single FD frame has no checksum of its own: the bus's must do, and here none was computed.
      if (fd && run % 2 == 0 && number < 0) continue;
      REQUIRE(number > newest);
      REQUIRE(number < 1000);
      newest = number;
      ++delivered;
    }
    possible += 40;
  }
  CHECK(delivered > possible / 2);
}

TEST_CASE("A lost transfer is counted from the ids, and the reading's counter goes on by it", "[can]") {
  std::vector<CanFrame> frames;
  for (const std::uint64_t number : {30U, 31U, 32U, 37U, 38U})
    append(frames, canflight::frames(number, kNode, false));
  RawImuDecoder decoder;
  const std::vector<ImuReading> readings = readingsOf(decoder, frames);
  REQUIRE(readings.size() == 5);
  CHECK(decoder.transfers().lost == 4);
  CHECK(*readings[4].counter - *readings[0].counter == 8);
}

TEST_CASE("A transfer sent twice is one reading", "[can]") {
  for (const bool fd : {false, true}) {
    std::vector<CanFrame> frames;
    append(frames, canflight::frames(1, kNode, fd));
    const DroneCanFrames twice = canflight::frames(2, kNode, fd);
    append(frames, twice);
    frames.push_back(twice.frames[twice.count - 1]);
    append(frames, canflight::frames(3, kNode, fd));
    RawImuDecoder decoder;
    CHECK(readingsOf(decoder, frames).size() == 3);
    CHECK(decoder.transfers().repeated == 1);
    CHECK(decoder.transfers().lost == 0);
  }
}

TEST_CASE("Half a transfer, then silence: what comes after it is not joined to it", "[can]") {
  std::vector<CanFrame> frames;
  append(frames, canflight::frames(5, kNode, false));
  const std::vector<CanFrame> all = frames;
  RawImuDecoder decoder;
  ImuReading reading;
  for (std::size_t i = 0; i < 3; ++i) CHECK(!decoder.take(all[i], reading));
  for (std::size_t i = 3; i < all.size(); ++i) {
    CanFrame late = all[i];
    late.arrival = late.arrival + Duration::fromMilliseconds(2100);
    CHECK(!decoder.take(late, reading));
  }
  CHECK(decoder.transfers().timeouts == 1);
  CHECK(decoder.counters().readings == 0);
}

TEST_CASE("The end of one transfer is not joined to the beginning of another", "[can]") {
  const DroneCanFrames first = canflight::frames(5, kNode, false);
  const DroneCanFrames second = canflight::frames(6, kNode, false);
  RawImuDecoder decoder;
  ImuReading reading;
  for (std::size_t i = 0; i < 4; ++i) CHECK(!decoder.take(first.frames[i], reading));
  for (std::size_t i = 4; i < second.count; ++i) CHECK(!decoder.take(second.frames[i], reading));
  CHECK(decoder.transfers().broken == 1);
  CHECK(decoder.transfers().checksum == 0);
  CHECK(decoder.transfers().strays == second.count - 5);
}

TEST_CASE("The first node that speaks is kept; others are counted", "[can]") {
  std::vector<CanFrame> frames;
  for (std::uint64_t i = 0; i < 3; ++i) {
    append(frames, canflight::frames(i, 7, false));
    append(frames, canflight::frames(i, 8, true));
  }
  RawImuDecoder first;
  CHECK(readingsOf(first, frames).size() == 3);
  CHECK(first.node() == 7);
  CHECK(first.counters().other_nodes == 3);
  RawImuDecoder eighth(8);
  CHECK(readingsOf(eighth, frames).size() == 3);
  CHECK(eighth.counters().other_nodes == 3);
}

TEST_CASE("Values that are no numbers, and frames of others, make no reading", "[can]") {
  RawImu raw = canflight::imu(1);
  std::array<std::uint8_t, kMaxRawImuBytes> bytes = {};
  DroneCanFrames frames;
  ImuReading reading;
  RawImuDecoder decoder;
  const auto take = [&](const RawImu& imu, unsigned id) {
    const std::size_t size = encodeRawImu(imu, false, bytes);
    REQUIRE(encodeTransfer(rawImuType(), 0, kNode, id, false, {bytes.data(), size}, frames));
    bool got = false;
    for (std::size_t i = 0; i < frames.count; ++i) got = decoder.take(frames.frames[i], reading) || got;
    return got;
  };
  raw.rate_integral.y() = std::numeric_limits<float>::quiet_NaN();
  CHECK(!take(raw, 1));
  raw = canflight::imu(1);
  raw.interval = std::numeric_limits<float>::infinity();
  CHECK(!take(raw, 2));
  raw.interval = std::numeric_limits<float>::quiet_NaN();
  CHECK(!take(raw, 3));
  raw.interval = 5;
  CHECK(!take(raw, 4));
  raw.interval = 0.0025F;
  raw.stamp_us = (1ULL << 56U) - 1;
  CHECK(!take(raw, 5));
  CHECK(decoder.counters().not_finite == 5);
  CHECK(take(canflight::imu(1), 6));
  CanFrame other = frames.frames[0];
  other.extended = false;
  CHECK(!decoder.take(other, reading));
  other.extended = true;
  other.size = 0;
  CHECK(!decoder.take(other, reading));
  CHECK(decoder.counters().readings == 1);
}

TEST_CASE("A payload too long for its frames is refused, an empty one fits", "[can]") {
  DroneCanFrames frames;
  const std::vector<std::uint8_t> bytes(200);
  CHECK(!encodeTransfer(rawImuType(), 0, 1, 0, false, {bytes.data(), 131}, frames));
  CHECK(encodeTransfer(rawImuType(), 0, 1, 0, false, {bytes.data(), 130}, frames));
  CHECK(frames.count == 19);
  CHECK(!encodeTransfer(rawImuType(), 0, 1, 0, true, {bytes.data(), 131}, frames));
  CHECK(encodeTransfer(rawImuType(), 0, 1, 0, true, {bytes.data(), 0}, frames));
  CHECK(frames.count == 1);
  CHECK(frames.frames[0].size == 1);
}

}  // namespace
}  // namespace swiftlet
