#pragma once
// Maps GStreamer's raw video formats to PixelFormat and back, and makes the caps of the sink.

#include <gst/video/video.h>

#include <optional>

#include "drivers/image/pixel_format.hpp"

namespace swiftlet {

/// Empty: not supported (RGB, Bayer, ...); the user's pipeline converts these with `videoconvert`.
[[nodiscard]] std::optional<PixelFormat> pixelFormatOf(GstVideoFormat format);

/// Caps of the sink, to be unreferenced: the formats in the order of kPixelFormats, first at this size and
/// rate (0: any), then at this size, then at any size. A source with a choice selects the first match; a
/// source without one shows what it delivers.
[[nodiscard]] GstCaps* acceptedCaps(int width, int height, double rate);

}  // namespace swiftlet
