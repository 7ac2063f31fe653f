#pragma once
// Pictures as FFmpeg encodes them: an encoder of all pixel formats that is not ours.

#include <array>
#include <cstdint>
#include <string>
#include <vector>

namespace swiftlet::ffmpeg {

/// RGB, 8 bits each, rows without padding.
struct Picture {
  int width = 0;
  int height = 0;
  std::vector<std::uint8_t> rgb;
};

/// Smooth in colour and brightness, with a little texture.
Picture picture(int width, int height);

/// All planes one after the other, rows without padding. `format`: FFmpeg's name, "nv12".
std::vector<std::uint8_t> as(const Picture& picture, const std::string& format);

/// Motion JPEG. `format`: "yuvj420p", "yuvj422p", "yuvj444p"; `quality`: 2 the best, 31 the worst.
std::vector<std::uint8_t> jpeg(const Picture& picture, const std::string& format, int quality);
/// The luma that FFmpeg's own decoder makes of it.
std::vector<std::uint8_t> luma(const std::vector<std::uint8_t>& jpeg);

}  // namespace swiftlet::ffmpeg
