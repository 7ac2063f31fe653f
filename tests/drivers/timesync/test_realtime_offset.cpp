#include <catch2/catch.hpp>

#include <array>
#include <limits>
#include <vector>

#include "drivers/timesync/exposure_midpoint.hpp"
#include "drivers/timesync/realtime_clock.hpp"
#include "estimator/core/random.hpp"

namespace swiftlet {
namespace {

/// Ten readings of clocks `offset` apart, each with its own times between; the true offset is inside all.
std::vector<ClockReading> readings(Random& random, std::int64_t from, std::int64_t offset) {
  std::vector<ClockReading> all;
  for (int i = 0; i < 10; ++i) {
    ClockReading r;
    r.before = {from};
    from += 20 + random.below(i == 6 ? 10 : 5000);
    r.real = {from + offset};
    from += 20 + random.below(i == 6 ? 10 : 5000);
    r.after = {from};
    all.push_back(r);
  }
  return all;
}

TEST_CASE("The best of ten readings gives the offset within its bound", "[timesync]") {
  Random random(5);
  for (int run = 0; run < 200; ++run) {
    RealtimeOffset clock;
    constexpr std::int64_t kOffset = 1'700'000'000'000'000'000;
    CHECK(clock.due({0}));
    Stamp out;
    CHECK(clock.toMonotonic({0}, out).code == StatusCode::kNotReady);
    REQUIRE(clock.measure(readings(random, 1'000'000'000, kOffset)).ok());
    CHECK(std::abs(clock.offset().ns - kOffset) <= clock.errorBound().ns);
    CHECK(clock.errorBound().ns <= 30);
    REQUIRE(clock.toMonotonic({kOffset + 500}, out).ok());
    CHECK(std::abs(out.ns - 500) <= clock.errorBound().ns);
  }
}

TEST_CASE("Measured each second, at a step at once; slewing is no step", "[timesync]") {
  Random random(6);
  RealtimeOffset clock;
  std::int64_t now = 1'000'000'000;
  std::int64_t offset = 1'000'000'000'000;
  REQUIRE(clock.measure(readings(random, now, offset)).ok());
  CHECK(!clock.due({now + 900'000'000}));
  CHECK(clock.due({now + 1'100'000'000}));
  for (int i = 0; i < 20; ++i) {
    now += 1'000'000'000;
    offset += 400'000;  // 400 ppm
    REQUIRE(clock.measure(readings(random, now, offset)).ok());
  }
  CHECK(clock.steps() == 0);
  now += 1'000'000'000;
  offset -= 3'000'000;
  clock.expire();
  CHECK(clock.due({now}));
  REQUIRE(clock.measure(readings(random, now, offset)).ok());
  CHECK(clock.steps() == 1);
  CHECK(std::abs(clock.offset().ns - offset) <= clock.errorBound().ns);
}

TEST_CASE("A step among the readings is seen, readings out of order are not taken", "[timesync]") {
  Random random(7);
  RealtimeOffset clock;
  auto torn = readings(random, 1000, 5'000'000);
  for (std::size_t i = 5; i < torn.size(); ++i) torn[i].real.ns += 1'000'000;
  CHECK(clock.measure(torn).code == StatusCode::kNotReady);
  CHECK(clock.due({0}));
  CHECK(clock.measure({}).code == StatusCode::kInvalidInput);
  const std::array<ClockReading, 1> reversed = {ClockReading{{10}, {5}, {9}}};
  CHECK(clock.measure(reversed).code == StatusCode::kInvalidInput);
  constexpr std::int64_t kMost = std::numeric_limits<std::int64_t>::max();
  constexpr std::int64_t kLeast = std::numeric_limits<std::int64_t>::min();
  const std::array<std::int64_t, 6> odd = {0, kMost, kLeast, (1LL << 61U) - 1, 1 - (1LL << 61U), 77};
  for (int i = 0; i < 10'000; ++i) {
    const auto any = [&] { return Stamp{odd[random.below(odd.size())]}; };
    const std::array<ClockReading, 2> hostile = {ClockReading{any(), any(), any()},
                                                 ClockReading{any(), any(), any()}};
    (void)clock.measure(hostile);
    Stamp out;
    (void)clock.toMonotonic(any(), out);
    (void)clock.due(any());
  }
}

TEST_CASE("This machine's clocks", "[timesync]") {
  RealtimeClock clock;
  CHECK(clock.open().ok());
  CHECK(clock.fd() >= 0);
  REQUIRE(clock.update().ok());
  const Stamp before = monotonicNow();
  Stamp out;
  REQUIRE(clock.toMonotonic(before + clock.offset().offset(), out).ok());
  CHECK(out == before);
  // Microseconds in practice; a loaded machine may stop between two reads.
  CHECK(clock.offset().errorBound().ns < 1'000'000);
}

TEST_CASE("Exposure midpoint from each event, global and rolling", "[timesync]") {
  constexpr std::int64_t kStart = 1'000'000'000;
  ExposureTiming t{.exposure = {8'000'000}, .readout = {12'000'000}, .trigger_latency = {30'000}};
  const Stamp start{kStart};
  const Stamp end = start + t.exposure + t.readout;
  const Stamp edge = start - t.trigger_latency;
  const Stamp middle{kStart + 4'000'000};
  CHECK(exposureMidpoint(start, FrameEvent::kStartOfExposure, t) == middle);
  CHECK(exposureMidpoint(end, FrameEvent::kEndOfFrame, t) == middle);
  CHECK(exposureMidpoint(edge, FrameEvent::kTriggerEdge, t) == middle);
  t.rolling = true;
  const Stamp middle_row{kStart + 10'000'000};
  CHECK(exposureMidpoint(start, FrameEvent::kStartOfExposure, t) == middle_row);
  CHECK(exposureMidpoint(end, FrameEvent::kEndOfFrame, t) == middle_row);
  CHECK(exposureMidpoint(edge, FrameEvent::kTriggerEdge, t) == middle_row);
  CHECK(edge + expectedLag(FrameEvent::kEndOfFrame, t) == end);
  CHECK(edge + expectedLag(FrameEvent::kStartOfExposure, t) == start);
}

}  // namespace
}  // namespace swiftlet
