#pragma once
// GStreamer's raw video formats and PixelFormat's, one for the other, and what the sink asks for.

#include <gst/video/video.h>

#include <optional>

#include "drivers/image/pixel_format.hpp"

namespace swiftlet {

/// Empty: not taken (RGB, Bayer, ...). The user's pipeline converts such, by `videoconvert`.
[[nodiscard]] std::optional<PixelFormat> pixelFormatOf(GstVideoFormat format);

/// Caps of the sink, to be unreferenced: the formats in the order of kPixelFormats, first at this size and
/// rate (0: any), then at this size, then at any. A source with a choice selects the right one; a source
/// without a choice reveals what it delivers.
[[nodiscard]] GstCaps* acceptedCaps(int width, int height, double rate);

}  // namespace swiftlet
