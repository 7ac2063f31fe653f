// Stands in for ros_bag.cpp in builds without rosbag-storage.

#include "drivers/recorded/ros_bag.hpp"

namespace swiftlet {

std::unique_ptr<LogSource> openRosBag(const std::string& path, const LogOptions&) {
  throw InputError(path, 0, "", "this build cannot read ROS bags",
                   "Install librosbag-storage-dev and build again, or convert the bag to a EuRoC folder");
}

}  // namespace swiftlet
