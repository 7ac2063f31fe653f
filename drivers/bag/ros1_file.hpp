#pragma once
// Reads ROS 1 bags of format 2.0, not encrypted.

#include <memory>
#include <string>

#include "drivers/bag/bag_file.hpp"

namespace swiftlet {

/// `name` names the file in messages.
[[nodiscard]] std::unique_ptr<BagFile> openRos1File(const std::string& path, const std::string& name);

}  // namespace swiftlet
