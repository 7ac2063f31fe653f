#include "drivers/recorded/open_log.hpp"

#include <filesystem>

#include "drivers/bag/bag_file.hpp"
#include "drivers/recorded/asl_folder.hpp"
#include "drivers/recorded/bag_log.hpp"
#include "drivers/recorded/recording_source.hpp"

namespace swiftlet {
namespace {

constexpr const char* kWhatToGive =
    "Give a EuRoC folder (the sequence or its mav0) or an archive of one, a bag (rosbag2, MCAP or ROS 1), or "
    "a run folder with a recording";

}  // namespace

std::unique_ptr<LogSource> openLog(const std::string& path, const LogOptions& options) {
  if (!std::filesystem::exists(path)) {
    throw InputError(path, 0, "", "does not exist", kWhatToGive);
  }
  if (isAslFolder(path)) return openAslFolder(path, options);
  if (isRecording(path)) return openRecording(path, options);
  if (isArchive(path)) return openAslFolder(path, options);
  if (isBag(path)) return openBagLog(path, options);
  throw InputError(
      path, 0, "",
      "is not a log: neither a folder with imu0 and cam0 or an archive of one, nor a bag, nor a recording",
      kWhatToGive);
}

}  // namespace swiftlet
