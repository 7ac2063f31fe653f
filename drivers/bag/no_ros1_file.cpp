// Replaces ros1_file.cpp in builds without rosbag-storage.

#include "drivers/bag/ros1_file.hpp"
#include "drivers/input/input_error.hpp"

namespace swiftlet {

std::unique_ptr<BagFile> openRos1File(const std::string& /*path*/, const std::string& name) {
  throw InputError(name, 0, "", "this build cannot read ROS 1 bags",
                   "Install librosbag-storage-dev and build again, or convert the bag to MCAP");
}

std::unique_ptr<BagWriter> makeRos1Writer(const std::string& path) {
  throw InputError(path, 0, "", "this build cannot write ROS 1 bags",
                   "Install librosbag-storage-dev and build again, or export with --mcap or --tum");
}

bool hasRos1Bags() { return false; }

}  // namespace swiftlet
