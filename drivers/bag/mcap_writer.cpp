#include <algorithm>
#include <limits>
#include <map>
#include <vector>

#include "drivers/bag/bag_writer.hpp"
#include "drivers/bag/byte_buffer.hpp"
#include "drivers/bag/mcap_records.hpp"
#include "drivers/bag/output_file.hpp"
#include "drivers/bag/qos_text.hpp"
#include "drivers/bag/unpack.hpp"

namespace swiftlet {
namespace {

using Bytes = std::span<const std::uint8_t>;
using mcap::crcOf;
using mcap::Op;

constexpr std::size_t kChunkBytes = std::size_t{1}
                                    << 20U;  // as in rosbag2: holds some images, or seconds of IMU

/// A buffer of consecutive records.
class Records : public ByteBuffer {
 public:
  template <typename Fill>
  void add(Op op, Fill&& fill) {
    u8(static_cast<std::uint8_t>(op));
    const std::size_t length = size();
    u64(0);
    fill(*this);
    setU64(length, size() - length - sizeof(std::uint64_t));
  }
  void text(std::string_view text) {
    u32(static_cast<std::uint32_t>(text.size()));
    copy({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()});
  }
};

class McapWriter final : public BagWriter {
 public:
  McapWriter(const std::string& path, McapPacking packing) : packing_(packing), file_(path) {
    write(mcap::kMagic);
    records_.add(Op::kHeader, [](Records& r) {
      r.text("ros2");
      r.text("swiftlet");
    });
    flushRecords();
  }

  [[nodiscard]] BagEncoding encoding() const override { return BagEncoding::kCdr; }

  std::uint32_t addTopic(const BagWriterTopic& topic) override {
    // Schema and channel are written before the first message, so that a cut file can be read.
    if (!schemas_.contains(topic.type)) {
      schemas_.emplace(topic.type, static_cast<std::uint16_t>(schemas_.size() + 1));
      addSchema(chunk_, topic);
      addSchema(summary_, topic);
    }
    const auto channel = static_cast<std::uint16_t>(channels_.size());
    channels_.push_back({});
    addChannel(chunk_, channel, topic);
    addChannel(summary_, channel, topic);
    return channel;
  }

  void write(std::uint32_t topic, Stamp log_time, std::uint32_t sequence, Bytes body) override {
    const auto time = static_cast<std::uint64_t>(log_time.ns);
    Channel& channel = channels_[topic];
    channel.index.u64(time);
    channel.index.u64(chunk_.size());
    ++channel.messages;
    if (chunk_messages_++ == 0) chunk_first_ = chunk_last_ = time;
    chunk_first_ = std::min(chunk_first_, time);
    chunk_last_ = std::max(chunk_last_, time);
    chunk_.add(Op::kMessage, [&](Records& r) {
      r.u16(static_cast<std::uint16_t>(topic));
      r.u32(sequence);
      r.u64(time);
      r.u64(time);
      r.copy(body);
    });
    if (chunk_.size() >= kChunkBytes) endChunk();
  }

  void finish() override {
    endChunk();
    records_.add(Op::kDataEnd, [this](Records& r) { r.u32(crc_); });
    flushRecords();
    writeSummary();
    write(mcap::kMagic);
    file_.close();
  }

 private:
  struct Channel {
    Records index;  ///< of the chunk being filled
    std::uint64_t messages = 0;
  };

  void write(Bytes bytes) {
    file_.write(bytes);
    crc_ = crcOf(crc_, bytes);
  }
  void flushRecords() {
    write(records_.bytes());
    records_.clear();
  }

  void addSchema(Records& to, const BagWriterTopic& topic) {
    to.add(Op::kSchema, [&](Records& r) {
      r.u16(schemas_.at(topic.type));
      r.text(ros2Type(topic.type));
      r.text("ros2msg");
      r.text(topic.definition);
    });
  }
  void addChannel(Records& to, std::uint16_t id, const BagWriterTopic& topic) {
    to.add(Op::kChannel, [&](Records& r) {
      r.u16(id);
      r.u16(schemas_.at(topic.type));
      r.text(topic.name);
      r.text("cdr");
      Records metadata;
      metadata.text("offered_qos_profiles");
      metadata.text(qosText(topic.latched));
      r.u32(static_cast<std::uint32_t>(metadata.size()));
      r.copy(metadata.bytes());
    });
  }

  void endChunk() {
    if (chunk_.size() == 0) return;
    std::vector<std::uint8_t> packed;
    if (packing_ == McapPacking::kZstd) packed = packZstd(chunk_.bytes());
    const bool smaller = !packed.empty() && packed.size() < chunk_.size();
    const Bytes data = smaller ? Bytes(packed) : chunk_.bytes();
    const char* name = smaller ? "zstd" : "";
    const std::uint64_t begin = file_.size();
    records_.add(Op::kChunk, [&](Records& r) {
      r.u64(chunk_first_);
      r.u64(chunk_last_);
      r.u64(chunk_.size());
      r.u32(crcOf(0, chunk_.bytes()));
      r.text(name);
      r.u64(data.size());
      r.copy(data);
    });
    flushRecords();
    const std::uint64_t length = file_.size() - begin;
    Records offsets;
    for (std::size_t id = 0; id < channels_.size(); ++id) {
      Records& index = channels_[id].index;
      if (index.size() == 0) continue;
      offsets.u16(static_cast<std::uint16_t>(id));
      offsets.u64(file_.size() + records_.size());
      records_.add(Op::kMessageIndex, [&](Records& r) {
        r.u16(static_cast<std::uint16_t>(id));
        r.u32(static_cast<std::uint32_t>(index.size()));
        r.copy(index.bytes());
      });
      index.clear();
    }
    const std::uint64_t index_length = records_.size();
    flushRecords();
    chunk_indexes_.add(Op::kChunkIndex, [&](Records& r) {
      r.u64(chunk_first_);
      r.u64(chunk_last_);
      r.u64(begin);
      r.u64(length);
      r.u32(static_cast<std::uint32_t>(offsets.size()));
      r.copy(offsets.bytes());
      r.u64(index_length);
      r.text(name);
      r.u64(data.size());
      r.u64(chunk_.size());
    });
    ++chunks_;
    if (chunk_messages_ > 0) {
      first_ = std::min(first_, chunk_first_);
      last_ = std::max(last_, chunk_last_);
      messages_ += chunk_messages_;
    }
    chunk_.clear();
    chunk_messages_ = 0;
    chunk_first_ = chunk_last_ = 0;
  }

  void writeSummary() {
    const std::uint64_t begin = file_.size();
    crc_ = 0;
    write(summary_.bytes());
    records_.add(Op::kStatistics, [this](Records& r) {
      r.u64(messages_);
      r.u16(static_cast<std::uint16_t>(schemas_.size()));
      r.u32(static_cast<std::uint32_t>(channels_.size()));
      r.u32(0);  // attachments
      r.u32(0);  // metadata
      r.u32(chunks_);
      r.u64(messages_ == 0 ? 0 : first_);
      r.u64(last_);
      Records counts;
      for (std::size_t id = 0; id < channels_.size(); ++id) {
        counts.u16(static_cast<std::uint16_t>(id));
        counts.u64(channels_[id].messages);
      }
      r.u32(static_cast<std::uint32_t>(counts.size()));
      r.copy(counts.bytes());
    });
    records_.copy(chunk_indexes_.bytes());
    records_.u8(static_cast<std::uint8_t>(Op::kFooter));
    records_.u64(mcap::kFooterContent);
    records_.u64(begin);
    records_.u64(0);  // no summary offsets
    flushRecords();
    records_.u32(crc_);
    flushRecords();
  }

  McapPacking packing_;
  OutputFile file_;
  std::uint32_t crc_ = 0;  ///< of the data, later of the summary
  Records records_;        ///< waiting to be written
  Records chunk_;          ///< being filled
  std::uint64_t chunk_messages_ = 0, chunk_first_ = 0, chunk_last_ = 0;
  std::map<std::string, std::uint16_t> schemas_;  ///< numbers by type
  std::vector<Channel> channels_;
  Records summary_;  ///< schemas and channels
  Records chunk_indexes_;
  std::uint32_t chunks_ = 0;
  std::uint64_t messages_ = 0;
  std::uint64_t first_ = std::numeric_limits<std::uint64_t>::max();
  std::uint64_t last_ = 0;
};

}  // namespace

std::unique_ptr<BagWriter> makeMcapWriter(const std::string& path, McapPacking packing) {
  return std::make_unique<McapWriter>(path, packing);
}

}  // namespace swiftlet
