#pragma once
// Pixel formats of the encodings of ROS's sensor_msgs/Image (sensor_msgs/image_encodings.hpp).

#include <optional>
#include <string_view>

#include "drivers/image/pixel_format.hpp"

namespace swiftlet {

/// Empty: an encoding without grey, or one that no camera listed in docs/ros2.md sends. `big_endian`: byte
/// order of 16-bit pixels.
[[nodiscard]] std::optional<PixelFormat> rosEncoding(std::string_view name, bool big_endian);

}  // namespace swiftlet
