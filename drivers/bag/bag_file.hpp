#pragma once
// Reads files of recorded messages: rosbag2 folders (SQLite or MCAP), their single files, MCAP files, and ROS
// 1 bags. Messages stay bytes here; drivers/bag/ros_messages.hpp decodes them.
//
// Order: by the time at which the recorder received a message; equal times in the file's order. Errors:
// InputError with file, byte or row, and the remedy. Every read is bounds-checked and checksums are verified
// if present: a damaged file is rejected when it is opened or when the damaged message is read. If the
// recorder did not close the file, its intact part is read and a warning names the byte where it ends.
// Memory: 24 bytes per message, and four decompressed chunks of an MCAP file or ROS 1 bag. Threads: one per
// file. Host side only.

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "estimator/core/stamp.hpp"

namespace swiftlet {

enum class BagEncoding : std::uint8_t {
  kRos1,   ///< packed, little-endian
  kCdr,    ///< ROS 2: a header of four bytes, then aligned CDR
  kOther,  ///< not decoded: JSON, Protobuf, ...
};

struct BagTopic {
  std::string name;
  std::string type;  ///< `sensor_msgs/Imu`, also for ROS 2
  BagEncoding encoding = BagEncoding::kOther;
  std::uint64_t messages = 0;
  std::string definition;  ///< text of the message definition; empty if the file does not hold it
};

struct BagEntry {
  Stamp log_time;
  std::uint32_t topic = 0;  ///< index into topics()
  std::uint32_t part = 0;   ///< file or chunk; meaning depends on the format
  std::uint64_t at = 0;     ///< position in it; meaning depends on the format
};

class BagFile {
 public:
  explicit BagFile(std::string path) : path_(std::move(path)) {}
  BagFile(const BagFile&) = delete;
  BagFile& operator=(const BagFile&) = delete;
  virtual ~BagFile() = default;

  [[nodiscard]] const std::string& path() const { return path_; }
  [[nodiscard]] const std::vector<BagTopic>& topics() const { return topics_; }
  [[nodiscard]] const std::vector<BagEntry>& entries() const { return entries_; }
  [[nodiscard]] const std::vector<std::string>& warnings() const { return warnings_; }

  /// The body of a message, valid until the next call.
  virtual std::span<const std::uint8_t> read(const BagEntry& entry) = 0;

  /// InputError if a stamp of this topic is out of range (stamp_range.hpp).
  void checkStamp(std::uint32_t topic, Stamp stamp) const;

 protected:
  /// The topic with this name, type and encoding; added if there is none.
  std::uint32_t topicOf(std::string_view name, std::string_view type, BagEncoding encoding,
                        std::string_view definition);
  /// Sorts and counts the entries. Call once all of them are added.
  void orderEntries();

  std::string path_;
  std::vector<BagTopic> topics_;
  std::vector<BagEntry> entries_;
  std::vector<std::string> warnings_;
};

/// True for a rosbag2 folder and for a file whose first bytes are those of a bag, also compressed with zstd.
[[nodiscard]] bool isBag(const std::string& path);

/// The kind is detected from the content.
[[nodiscard]] std::unique_ptr<BagFile> openBag(const std::string& path);

}  // namespace swiftlet
