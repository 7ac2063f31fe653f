#pragma once
// What rosbag2 keeps of a topic beside its messages.

#include <string>
#include <string_view>

namespace swiftlet {

/// `sensor_msgs/msg/Imu` of `sensor_msgs/Imu`.
[[nodiscard]] std::string ros2Type(std::string_view type);

/// The qualities of service that a player offers. Latched: late subscribers receive the last message.
[[nodiscard]] std::string qosText(bool latched);

}  // namespace swiftlet
