#include <catch2/catch.hpp>

#include "drivers/timesync/exposure_midpoint.hpp"

namespace swiftlet {
namespace {

TEST_CASE("Exposure midpoint from each event, global and rolling", "[timesync]") {
  constexpr std::int64_t kStart = 1'000'000'000;
  ExposureTiming t{.exposure = {8'000'000}, .readout = {12'000'000}, .trigger_latency = {30'000}};
  const Stamp start{kStart};
  const Stamp end = start + t.exposure + t.readout;
  const Stamp exposed = start + t.exposure;
  const Stamp edge = start - t.trigger_latency;
  const Stamp middle{kStart + 4'000'000};
  CHECK(exposureMidpoint(start, FrameEvent::kStartOfExposure, t) == middle);
  CHECK(exposureMidpoint(exposed, FrameEvent::kEndOfExposure, t) == middle);
  CHECK(exposureMidpoint(end, FrameEvent::kEndOfFrame, t) == middle);
  CHECK(exposureMidpoint(edge, FrameEvent::kTriggerEdge, t) == middle);
  t.rolling = true;
  const Stamp middle_row{kStart + 10'000'000};
  CHECK(exposureMidpoint(start, FrameEvent::kStartOfExposure, t) == middle_row);
  CHECK(exposureMidpoint(exposed, FrameEvent::kEndOfExposure, t) == middle_row);
  CHECK(exposureMidpoint(end, FrameEvent::kEndOfFrame, t) == middle_row);
  CHECK(exposureMidpoint(edge, FrameEvent::kTriggerEdge, t) == middle_row);
  CHECK(edge + expectedLag(FrameEvent::kEndOfFrame, t) == end);
  CHECK(edge + expectedLag(FrameEvent::kEndOfExposure, t) == exposed);
  CHECK(edge + expectedLag(FrameEvent::kStartOfExposure, t) == start);
}

}  // namespace
}  // namespace swiftlet
