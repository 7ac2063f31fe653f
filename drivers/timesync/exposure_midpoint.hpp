#pragma once
// Computes the middle of the exposure, which is the stamp of an image, from the event that a camera driver or
// a trigger line stamps. For a rolling shutter it is the middle of the middle row's exposure.

#include <cstdint>

#include "estimator/core/stamp.hpp"

namespace swiftlet {

enum class FrameEvent : std::uint8_t {
  kStartOfExposure,  ///< of the first row (V4L2 SOE)
  kEndOfExposure,    ///< of the first row
  kEndOfFrame,       ///< the last row was read out (V4L2 EOF)
  kTriggerEdge,      ///< the edge that started the exposure
};

struct ExposureTiming {
  Duration exposure;
  Duration readout;          ///< first to last row
  Duration trigger_latency;  ///< edge to start of exposure
  bool rolling = false;
};

/// Global shutter: start + e/2; end of exposure - e/2; end of frame - readout - e/2. Rolling shutter: half
/// the readout later, at the middle row. A trigger edge plus its latency is a start of exposure.
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

/// Expected time from the trigger edge to the driver's stamp (for TriggerMatcher).
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
