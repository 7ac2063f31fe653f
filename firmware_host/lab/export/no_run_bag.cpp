// Stands in for run_bag.cpp in builds without rosbag-storage and ROS 1 message packages.

#include "drivers/input/input_error.hpp"
#include "firmware_host/lab/export/run_bag.hpp"

namespace swiftlet {

std::map<std::string, std::uint64_t> writeRunBag(const RunFolder&, const BagTruth&, const RunBagOptions&,
                                                 const std::string& file) {
  throw InputError(
      file, 0, "", "this build cannot write ROS bags",
      "Install librosbag-storage-dev, libnav-msgs-dev, libtf2-msgs-dev, libvisualization-msgs-dev "
      "and libdiagnostic-msgs-dev and build again, or export with --tum");
}

bool canWriteBags() { return false; }

}  // namespace swiftlet
