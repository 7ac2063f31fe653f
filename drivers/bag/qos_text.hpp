#pragma once
// What rosbag2 stores about a topic besides its messages.

#include <string>
#include <string_view>

namespace swiftlet {

/// ROS 2 type name: `sensor_msgs/Imu` becomes `sensor_msgs/msg/Imu`.
[[nodiscard]] std::string ros2Type(std::string_view type);

/// Quality of service for players, as YAML. Latched: late subscribers receive the last message.
[[nodiscard]] std::string qosText(bool latched);

}  // namespace swiftlet
