#pragma once
// Writes files of messages: MCAP and rosbag2 for ROS 2, bags for ROS 1.
//
// An interrupted program leaves a partial file under the given path. To get a complete file or none, give a
// temporary path and rename it after finish(). Errors: InputError if the disk accepts no more data. Memory: a
// chunk of 1 MiB and 16 bytes per message in it, plus that of the libraries. Threads: one per file.
// Host side only.

#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "drivers/bag/bag_file.hpp"
#include "estimator/core/stamp.hpp"

namespace swiftlet {

struct BagWriterTopic {
  std::string name;
  std::string type;        ///< `sensor_msgs/Imu`
  std::string definition;  ///< text of the type for the writer's encoding
  std::string md5;         ///< of the definition; needed only by ROS 1
  bool latched = false;    ///< players repeat the last message to late subscribers
};

class BagWriter {
 public:
  BagWriter() = default;
  BagWriter(const BagWriter&) = delete;
  BagWriter& operator=(const BagWriter&) = delete;
  virtual ~BagWriter() = default;

  [[nodiscard]] virtual BagEncoding encoding() const = 0;
  /// Returns the topic's number for write().
  virtual std::uint32_t addTopic(const BagWriterTopic& topic) = 0;
  /// Log times should not decrease. `sequence` counts the messages of the topic.
  virtual void write(std::uint32_t topic, Stamp log_time, std::uint32_t sequence,
                     std::span<const std::uint8_t> body) = 0;
  /// Completes the file; nothing may be written afterwards.
  virtual void finish() = 0;
};

enum class McapPacking : std::uint8_t { kZstd, kNone };

[[nodiscard]] std::unique_ptr<BagWriter> makeMcapWriter(const std::string& path, McapPacking packing);

/// Writes without compression, with the same bytes as ROS's own rosbag.
[[nodiscard]] std::unique_ptr<BagWriter> makeRos1Writer(const std::string& path);

/// Creates the folder. `name`: prefix of the file in it, `<name>_0.db3`.
[[nodiscard]] std::unique_ptr<BagWriter> makeRosbag2Writer(const std::string& folder,
                                                           const std::string& name);

}  // namespace swiftlet
