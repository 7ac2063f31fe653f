#pragma once
// The middle of the exposure, which is an image's stamp, from what a camera's driver or a trigger line gives.
// Rolling shutter: of the middle row.

#include <cstdint>

#include "estimator/core/stamp.hpp"

namespace swiftlet {

enum class FrameEvent : std::uint8_t {
  kStartOfExposure,  ///< of the first row (V4L2 SOE)
  kEndOfExposure,    ///< of the first row
  kEndOfFrame,       ///< the last row was read out (V4L2 EOF)
  kTriggerEdge,      ///< the edge that started it
};

struct ExposureTiming {
  Duration exposure;
  Duration readout;          ///< first to last row
  Duration trigger_latency;  ///< edge to start of exposure
  bool rolling = false;
};

/// Global: start + e/2; end of exposure - e/2; end of frame - readout - e/2. Rolling: half the readout later,
/// since the middle row is. An edge is a start after its latency.
constexpr Stamp exposureMidpoint(Stamp stamp, FrameEvent event, const ExposureTiming& timing) {
  const std::int64_t half = timing.exposure.ns / 2;
  const std::int64_t half_readout = timing.readout.ns / 2;
  if (event == FrameEvent::kEndOfFrame) {
    return {stamp.ns - (timing.rolling ? half_readout : timing.readout.ns) - half};
  }
  if (event == FrameEvent::kEndOfExposure) return {stamp.ns - half + (timing.rolling ? half_readout : 0)};
  const std::int64_t latency = event == FrameEvent::kTriggerEdge ? timing.trigger_latency.ns : 0;
  return {stamp.ns + latency + half + (timing.rolling ? half_readout : 0)};
}

/// What to expect from the edge to the driver's stamp (TriggerMatcher).
constexpr Duration expectedLag(FrameEvent driver_stamps, const ExposureTiming& timing) {
  switch (driver_stamps) {
    case FrameEvent::kStartOfExposure:
      return timing.trigger_latency;
    case FrameEvent::kEndOfExposure:
      return timing.trigger_latency + timing.exposure;
    case FrameEvent::kEndOfFrame:
      return timing.trigger_latency + timing.exposure + timing.readout;
    case FrameEvent::kTriggerEdge:
      break;
  }
  return {};
}

}  // namespace swiftlet
