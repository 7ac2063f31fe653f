#pragma once
// Reads one SQLite file of a rosbag2 bag: tables `topics` and `messages`, which schema versions 1 to 4 share.
//
// Messages compressed individually with zstd are recognized by their first bytes. SQLite files have no
// checksums: a flipped byte inside a message is not detected here.

#include <memory>
#include <string>

#include "drivers/bag/bag_file.hpp"

namespace swiftlet {

/// `name` names the file in messages.
[[nodiscard]] std::unique_ptr<BagFile> openSqliteBag(const std::string& path, const std::string& name);

}  // namespace swiftlet
