#pragma once
// GStreamer's raw video formats and PixelFormat's, one for the other, and what the sink asks for.

#include <gst/video/video.h>

#include <optional>

#include "drivers/image/pixel_format.hpp"

namespace swiftlet {

/// Empty: not taken (RGB, Bayer, ...). The user's pipeline converts such, by `videoconvert`.
[[nodiscard]] std::optional<PixelFormat> pixelFormatOf(GstVideoFormat format);

/// What the sink takes, to be unreferenced: the formats in the order of kPixelFormats, first at this size and
/// rate (0: any), then at this size, then at any, so that a source which has a choice makes the right one and
/// one which has none says what it gives.
[[nodiscard]] GstCaps* acceptedCaps(int width, int height, double rate);

}  // namespace swiftlet
