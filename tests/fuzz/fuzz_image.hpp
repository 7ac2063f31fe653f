#pragma once
// What a camera may send as a frame, as a fuzz target.

#include <string_view>

namespace swiftlet::fuzz {

/// `text` is the format's number, a byte each for width, height, padding and whether two cameras share it,
/// and the frame's bytes.
void cameraFrame(std::string_view text);

}  // namespace swiftlet::fuzz
