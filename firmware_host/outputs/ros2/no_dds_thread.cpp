// Stands in for dds_thread.cpp in builds without Cyclone DDS.

#include <nlohmann/json.hpp>

#include "drivers/calibration/input_error.hpp"
#include "firmware_host/outputs/ros2/dds_thread.hpp"

namespace swiftlet {

class DdsThread::Work {};

DdsThread::DdsThread(LiveOutlet&, const DdsThreadOptions&) {
  throw InputError("settings", 0, "ros2.enabled", "this build has no DDS",
                   "Install cyclonedds-dev and configure with -DSWIFTLET_WITH_DDS=ON, or switch it off");
}
DdsThread::~DdsThread() = default;

// The constructor throws: nobody gets here.
const Heartbeat& DdsThread::heart() const {
  static const Heartbeat kNone;
  return kNone;
}

void DdsThread::tellEnd() {}
nlohmann::ordered_json DdsThread::finish() { return {}; }

}  // namespace swiftlet
