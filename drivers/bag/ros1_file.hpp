#pragma once
// Reads and writes ROS 1 bags (format 2.0) with rosbag-storage; functional only in builds that found it.

#include <memory>
#include <string>

#include "drivers/bag/bag_file.hpp"
#include "drivers/bag/bag_writer.hpp"

namespace swiftlet {

/// `name` names the file in messages. InputError in builds without rosbag-storage.
[[nodiscard]] std::unique_ptr<BagFile> openRos1File(const std::string& path, const std::string& name);

/// Writes without compression.
[[nodiscard]] std::unique_ptr<BagWriter> makeRos1Writer(const std::string& path);

/// False in builds without rosbag-storage.
[[nodiscard]] bool hasRos1Bags();

}  // namespace swiftlet
