#pragma once
// What a camera may send as a frame, and its topic as an image, as fuzz targets.

#include <string_view>

namespace swiftlet::fuzz {

/// `text` is the format's number, a byte each for width, height, padding and whether two cameras share it,
/// and the frame's bytes.
void cameraFrame(std::string_view text);

/// What a camera's topic may send. `text`: flags (1 compressed, 2 big endian), the calibration's width and
/// height and the length of the encoding, a byte each; width, height and step, 4 bytes each; the encoding;
/// data.
void topicImage(std::string_view text);

}  // namespace swiftlet::fuzz
