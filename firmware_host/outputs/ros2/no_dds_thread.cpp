// Replaces dds_thread.cpp in builds without Cyclone DDS.

#include "drivers/input/input_error.hpp"
#include "firmware_host/outputs/ros2/dds_thread.hpp"

namespace swiftlet {

DdsThread::DdsThread(LiveOutlet&, const DdsThreadOptions&) : Follower(nullptr) {
  throw InputError(
      "settings", 0, "ros2.enabled", "this build has no DDS",
      "Install cyclonedds-dev and configure with -DSWIFTLET_WITH_DDS=ON, or disable ros2.enabled");
}

}  // namespace swiftlet
