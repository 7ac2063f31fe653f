#pragma once
// Reads the folder of a rosbag2 bag: metadata.yaml (versions 1 to 9) and the files that it lists, SQLite or
// MCAP, each optionally compressed as a whole with zstd.
//
// Only the list of files is taken from metadata.yaml; the kind of each file is detected from its bytes. If
// the recorder was killed there is no metadata.yaml: the files are then read in the order of their numbers.

#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "drivers/bag/bag_file.hpp"

namespace swiftlet {

struct Rosbag2Metadata {
  std::vector<std::string> files;  ///< relative to the folder
  std::uint64_t messages = 0;      ///< as counted by the recorder
};

/// `name` names the file in messages. InputError if the text is not rosbag2 metadata.
[[nodiscard]] Rosbag2Metadata parseRosbag2Metadata(const std::string& name, std::string_view text);

[[nodiscard]] bool isRosbag2Folder(const std::string& path);
[[nodiscard]] std::unique_ptr<BagFile> openRosbag2Folder(const std::string& path);

}  // namespace swiftlet
