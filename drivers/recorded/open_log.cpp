#include "drivers/recorded/open_log.hpp"

#include <array>
#include <filesystem>
#include <fstream>
#include <string_view>

#include "drivers/recorded/asl_folder.hpp"
#include "drivers/recorded/recording_source.hpp"
#include "drivers/recorded/ros_bag.hpp"

namespace swiftlet {
namespace {

constexpr const char* kWhatToGive =
    "Give a EuRoC folder (the sequence or its mav0) or an archive of one, a ROS 1 bag, or a run's folder "
    "with its recording";

}  // namespace

bool isRosBag(const std::string& path) {
  constexpr std::string_view kMagic = "#ROSBAG V2.0\n";
  std::array<char, kMagic.size()> head{};
  std::ifstream file(path, std::ios::binary);
  file.read(head.data(), head.size());
  return file.gcount() == static_cast<std::streamsize>(head.size()) &&
         std::string_view(head.data(), head.size()) == kMagic;
}

std::unique_ptr<LogSource> openLog(const std::string& path, const LogOptions& options) {
  if (!std::filesystem::exists(path)) {
    throw InputError(path, 0, "", "does not exist", kWhatToGive);
  }
  if (isAslFolder(path) || isArchive(path)) return openAslFolder(path, options);
  if (!std::filesystem::is_directory(path) && isRosBag(path)) return openRosBag(path, options);
  if (isRecording(path)) return openRecording(path, options);
  throw InputError(path, 0, "",
                   "not a log: neither a folder with imu0 and cam0, nor a ROS 1 bag, nor a recording",
                   kWhatToGive);
}

}  // namespace swiftlet
