#pragma once
// Bags and the messages in them.

#include <string_view>

namespace swiftlet::fuzz {

/// The bytes as a body of ROS 1 and, as they are, of ROS 2.
void rosMessage(std::string_view text);
void mcap(std::string_view text);
void ros1Bag(std::string_view text);
void rosbag2Metadata(std::string_view text);

}  // namespace swiftlet::fuzz
