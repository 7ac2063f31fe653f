#pragma once
// Exposure and gain of an open camera: set by hand, read back. What the camera lacks or clamps comes back in
// words.

#include <cstdint>
#include <optional>

#include "drivers/device/device_fault.hpp"
#include "drivers/v4l2/video_node.hpp"
#include "estimator/core/stamp.hpp"

namespace swiftlet {

/// Automatic exposure off (and with it the habit of lowering the frame rate in the dark), then the time.
/// kChanged: clamped or rounded by more than one step; kUnsupported: no exposure time to set.
DeviceFault setExposure(const VideoNode& node, Duration exposure);
/// Automatic gain off, then GAIN, or ANALOGUE_GAIN where that is what there is.
DeviceFault setGain(const VideoNode& node, std::int32_t gain);

/// Empty: no control in units of time (raw sensors count lines).
[[nodiscard]] std::optional<Duration> readExposure(const VideoNode& node);
[[nodiscard]] std::optional<std::int32_t> readGain(const VideoNode& node);

}  // namespace swiftlet
