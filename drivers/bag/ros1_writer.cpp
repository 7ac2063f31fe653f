#include <algorithm>
#include <vector>

#include "drivers/bag/bag_writer.hpp"
#include "drivers/bag/byte_buffer.hpp"
#include "drivers/bag/output_file.hpp"
#include "drivers/bag/ros1_records.hpp"
#include "drivers/bag/ros_messages.hpp"

namespace swiftlet {
namespace ros1 {
namespace {

constexpr std::size_t kChunkBytes = std::size_t{768}
                                    << 10U;  // as in rosbag: holds some images, or seconds of IMU

Bytes bytesOf(std::string_view text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

/// Fields of a header, or records.
class Buffer : public ByteBuffer {
 public:
  /// Seconds and nanoseconds.
  ByteBuffer& time(Stamp stamp) {
    return u32(static_cast<std::uint32_t>(stamp.ns / rosmsg::kNsPerSecond))
        .u32(static_cast<std::uint32_t>(stamp.ns % rosmsg::kNsPerSecond));
  }
  Buffer& field(std::string_view name, Bytes value) {
    u32(static_cast<std::uint32_t>(name.size() + 1 + value.size())).copy(bytesOf(name)).u8('=').copy(value);
    return *this;
  }
  Buffer& field(std::string_view name, std::string_view value) { return field(name, bytesOf(value)); }
  Buffer& field(std::string_view name, std::uint32_t value) {
    return field(name, Buffer().u32(value).bytes());
  }
  Buffer& field(std::string_view name, Op op) {
    return field(name, Buffer().u8(static_cast<std::uint8_t>(op)).bytes());
  }
  void record(const Buffer& header, Bytes data) {
    u32(static_cast<std::uint32_t>(header.size())).copy(header.bytes());
    u32(static_cast<std::uint32_t>(data.size())).copy(data);
  }
};

/// The fields of each header are in alphabetical order, as rosbag writes them.
class Writer final : public BagWriter {
 public:
  explicit Writer(const std::string& path) : file_(path) {
    file_.write(bytesOf(kMagic));
    file_.write(bagRecord(0).bytes());
  }

  [[nodiscard]] BagEncoding encoding() const override { return BagEncoding::kRos1; }

  std::uint32_t addTopic(const BagWriterTopic& topic) override {
    Buffer fields;
    // A player needs this to repeat the last message to late subscribers.
    if (topic.latched) fields.field("latching", "1");
    fields.field("md5sum", topic.md5).field("message_definition", topic.definition);
    if (topic.latched) fields.field("topic", topic.name);
    fields.field("type", topic.type);
    const auto number = static_cast<std::uint32_t>(topics_.size());
    topics_.emplace_back().connection.record(
        Buffer().field("conn", number).field("op", Op::kConnection).field("topic", topic.name),
        fields.bytes());
    return number;
  }

  void write(std::uint32_t topic, Stamp log_time, std::uint32_t /*sequence*/, Bytes body) override {
    Topic& to = topics_[topic];
    // Before the topic's first message, so that a cut file can be read.
    if (!to.is_written) chunk_.copy(to.connection.bytes());
    to.is_written = true;
    if (chunk_messages_++ == 0) chunk_first_ = chunk_last_ = log_time;
    chunk_first_ = std::min(chunk_first_, log_time);
    chunk_last_ = std::max(chunk_last_, log_time);
    ++to.messages;
    to.index.time(log_time).u32(static_cast<std::uint32_t>(chunk_.size()));
    chunk_.record(Buffer()
                      .field("conn", topic)
                      .field("op", Op::kMessage)
                      .field("time", Buffer().time(log_time).bytes()),
                  body);
    if (chunk_.size() > kChunkBytes) endChunk();
  }

  void finish() override {
    endChunk();
    const std::uint64_t index = file_.size();
    for (const Topic& topic : topics_) file_.write(topic.connection.bytes());
    file_.write(chunk_infos_.bytes());
    file_.overwrite(kMagic.size(), bagRecord(index).bytes());
    file_.close();
  }

 private:
  struct Topic {
    Buffer connection;  ///< its record
    bool is_written = false;
    Buffer index;  ///< of the chunk being filled
    std::uint32_t messages = 0;
  };

  /// Padded, so that it can be written again in place.
  [[nodiscard]] Buffer bagRecord(std::uint64_t index) const {
    Buffer header;
    header.field("chunk_count", chunks_)
        .field("conn_count", static_cast<std::uint32_t>(topics_.size()))
        .field("index_pos", Buffer().u64(index).bytes())
        .field("op", Op::kBag);
    Buffer record;
    record.record(header, bytesOf(std::string(kBagRecord - header.size(), ' ')));
    return record;
  }

  void endChunk() {
    if (chunk_messages_ == 0) return;
    const auto size = static_cast<std::uint32_t>(chunk_.size());
    Buffer counts;
    std::uint32_t used = 0;
    Buffer records;
    records.record(Buffer().field("compression", "none").field("op", Op::kChunk).field("size", size),
                   chunk_.bytes());
    for (std::size_t i = 0; i < topics_.size(); ++i) {
      Topic& topic = topics_[i];
      if (topic.messages == 0) continue;
      ++used;
      const auto connection = static_cast<std::uint32_t>(i);
      counts.u32(connection).u32(topic.messages);
      records.record(Buffer()
                         .field("conn", connection)
                         .field("count", topic.messages)
                         .field("op", Op::kIndex)
                         .field("ver", kIndexVersion),
                     topic.index.bytes());
      topic.index.clear();
      topic.messages = 0;
    }
    chunk_infos_.record(Buffer()
                            .field("chunk_pos", Buffer().u64(file_.size()).bytes())
                            .field("count", used)
                            .field("end_time", Buffer().time(chunk_last_).bytes())
                            .field("op", Op::kChunkInfo)
                            .field("start_time", Buffer().time(chunk_first_).bytes())
                            .field("ver", kIndexVersion),
                        counts.bytes());
    file_.write(records.bytes());
    ++chunks_;
    chunk_.clear();
    chunk_messages_ = 0;
  }

  OutputFile file_;
  Buffer chunk_;  ///< being filled
  std::uint64_t chunk_messages_ = 0;
  Stamp chunk_first_, chunk_last_;
  std::vector<Topic> topics_;
  Buffer chunk_infos_;
  std::uint32_t chunks_ = 0;
};

}  // namespace
}  // namespace ros1

std::unique_ptr<BagWriter> makeRos1Writer(const std::string& path) {
  return std::make_unique<ros1::Writer>(path);
}

}  // namespace swiftlet
