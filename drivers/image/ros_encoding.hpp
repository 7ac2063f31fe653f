#pragma once
// The encodings of ROS's sensor_msgs/Image (sensor_msgs/image_encodings.hpp) as pixel formats.

#include <optional>
#include <string_view>

#include "drivers/image/pixel_format.hpp"

namespace swiftlet {

/// Empty: an encoding without grey in it, or that no camera of the tables in docs/ros2.md sends.
/// `big_endian`: of pixels of 16 bits.
[[nodiscard]] std::optional<PixelFormat> rosEncoding(std::string_view name, bool big_endian);

}  // namespace swiftlet
