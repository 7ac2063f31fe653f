#pragma once
// Opens a log of any kind that this build can read; the kind is detected by content.

#include <memory>
#include <string>

#include "drivers/recorded/log_source.hpp"

namespace swiftlet {

/// A EuRoC/ASL folder or an archive of one, a bag (rosbag2, MCAP, or ROS 1 if the build has rosbag-storage),
/// or a flight recording (its folder or that of its run). InputError otherwise.
std::unique_ptr<LogSource> openLog(const std::string& path, const LogOptions& options = {});

}  // namespace swiftlet
