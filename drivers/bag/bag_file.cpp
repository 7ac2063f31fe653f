#include "drivers/bag/bag_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <string_view>
#include <tuple>

#include "drivers/bag/bag_kind.hpp"
#include "drivers/bag/mcap_file.hpp"
#include "drivers/bag/ros1_file.hpp"
#include "drivers/bag/rosbag2_folder.hpp"
#include "drivers/bag/sqlite_bag.hpp"
#include "drivers/bag/unpack.hpp"
#include "drivers/input/input_error.hpp"
#include "drivers/input/stamp_range.hpp"

namespace swiftlet {
namespace {

std::string withoutMsg(std::string_view type) {
  std::string name(type);
  const std::size_t at = name.find("/msg/");
  if (at != std::string::npos) name.erase(at, 4);
  return name;
}

}  // namespace

std::uint32_t BagFile::topicOf(std::string_view name, std::string_view type, BagEncoding encoding,
                               std::string_view definition) {
  const std::string plain = withoutMsg(type);
  for (std::size_t i = 0; i < topics_.size(); ++i) {
    const BagTopic& topic = topics_[i];
    if (topic.name == name && topic.type == plain && topic.encoding == encoding) {
      return static_cast<std::uint32_t>(i);
    }
  }
  topics_.push_back({std::string(name), plain, encoding, 0, std::string(definition)});
  return static_cast<std::uint32_t>(topics_.size() - 1);
}

void BagFile::orderEntries() {
  std::sort(entries_.begin(), entries_.end(), [](const BagEntry& a, const BagEntry& b) {
    return std::tie(a.log_time.ns, a.part, a.at) < std::tie(b.log_time.ns, b.part, b.at);
  });
  for (const BagEntry& entry : entries_) {
    ++topics_[entry.topic].messages;
    checkStamp(entry.topic, entry.log_time);
  }
}

void BagFile::checkStamp(std::uint32_t topic, Stamp stamp) const {
  if (isStampInRange(stamp.ns)) return;
  throw InputError(path_ + " " + topics_[topic].name, 0, "timestamp",
                   fmt::format("{} ns is beyond the year 2096", stamp.ns),
                   "Record the bag with a clock that is set, or leave this topic out of it");
}

bool isBag(const std::string& path) {
  if (std::filesystem::is_directory(path)) return isRosbag2Folder(path);
  constexpr std::size_t kBegin = 16;  // bytes; enough to tell all kinds apart
  BagKind kind = bagKindOf(path);
  if (kind == BagKind::kZstd) kind = bagKindOf(std::string_view(unpackedBegin(path, kBegin)));
  return kind != BagKind::kNone && kind != BagKind::kZstd;
}

std::unique_ptr<BagFile> openBag(const std::string& path) {
  if (std::filesystem::is_directory(path)) return openRosbag2Folder(path);
  BagKind kind = bagKindOf(path);
  std::string file = path;
  // Unlinked once it is open, so no temporary file is left behind.
  std::unique_ptr<UnpackedFile> unpacked;
  if (kind == BagKind::kZstd) {
    unpacked = std::make_unique<UnpackedFile>(path);
    file = unpacked->path();
    kind = bagKindOf(file);
  }
  switch (kind) {
    case BagKind::kRos1:
      return openRos1File(file, path);
    case BagKind::kMcap:
      return openMcapFile(file, path);
    case BagKind::kSqlite:
      return openSqliteBag(file, path);
    default:
      throw InputError(path, 0, "byte 0", "is not a bag",
                       "Give a rosbag2 folder or its .db3, an MCAP file or a ROS 1 bag. Check that the file "
                       "is not empty or truncated");
  }
}

}  // namespace swiftlet
