#pragma once
// The folder of a rosbag2 bag: metadata.yaml (versions 1 to 9) and the files that it lists, SQLite or MCAP,
// each perhaps packed as a whole with zstd.
//
// Which files there are is all that is taken from metadata.yaml; what a file is, its own bytes say. A folder
// whose recorder was killed has no metadata.yaml: its files are then read in the order of their numbers.

#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "drivers/bag/bag_file.hpp"

namespace swiftlet {

struct Rosbag2Metadata {
  std::vector<std::string> files;  ///< relative to the folder
  std::uint64_t messages = 0;      ///< by the recorder's count
};

/// `name` names the file in messages. InputError for what is no such text.
[[nodiscard]] Rosbag2Metadata parseRosbag2Metadata(const std::string& name, std::string_view text);

[[nodiscard]] bool isRosbag2Folder(const std::string& path);
[[nodiscard]] std::unique_ptr<BagFile> openRosbag2Folder(const std::string& path);

}  // namespace swiftlet
