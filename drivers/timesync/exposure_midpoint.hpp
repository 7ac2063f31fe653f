#pragma once
// The middle of the exposure, which is an image's stamp, from what a camera's driver or a trigger line gives.
// Rolling shutter: of the middle row.

#include <cstdint>

#include "estimator/core/stamp.hpp"

namespace swiftlet {

enum class FrameEvent : std::uint8_t {
  kStartOfExposure,  ///< of the first row (V4L2 SOE)
  kEndOfFrame,       ///< the last row was read out (V4L2 EOF)
  kTriggerEdge,      ///< the edge that started it
};

struct ExposureTiming {
  Duration exposure;
  Duration readout;          ///< first to last row
  Duration trigger_latency;  ///< edge to start of exposure
  bool rolling = false;
};

/// Global: start + e/2; end - readout - e/2. Rolling: start + e/2 + readout/2; end - readout/2 - e/2. An edge
/// is a start after its latency.
constexpr Stamp exposureMidpoint(Stamp stamp, FrameEvent event, const ExposureTiming& timing) {
  const std::int64_t half = timing.exposure.ns / 2;
  const std::int64_t half_readout = timing.readout.ns / 2;
  if (event == FrameEvent::kEndOfFrame) {
    return {stamp.ns - (timing.rolling ? half_readout : timing.readout.ns) - half};
  }
  const std::int64_t latency = event == FrameEvent::kTriggerEdge ? timing.trigger_latency.ns : 0;
  return {stamp.ns + latency + half + (timing.rolling ? half_readout : 0)};
}

/// What to expect from the edge to the driver's stamp (TriggerMatcher).
constexpr Duration expectedLag(FrameEvent driver_stamps, const ExposureTiming& timing) {
  return driver_stamps == FrameEvent::kEndOfFrame
             ? timing.trigger_latency + timing.exposure + timing.readout
             : (driver_stamps == FrameEvent::kStartOfExposure ? timing.trigger_latency : Duration{});
}

}  // namespace swiftlet
