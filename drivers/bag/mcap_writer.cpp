#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <limits>
#include <map>
#include <vector>

#include "drivers/bag/bag_writer.hpp"
#include "drivers/bag/mcap_records.hpp"
#include "drivers/bag/qos_text.hpp"
#include "drivers/bag/unpack.hpp"
#include "drivers/input/input_error.hpp"

namespace swiftlet {
namespace {

using Bytes = std::span<const std::uint8_t>;
using mcap::crcOf;
using mcap::Op;

constexpr std::size_t kChunkBytes = std::size_t{1}
                                    << 20U;  // as in rosbag2: holds some images, or seconds of IMU

/// A buffer of consecutive records.
class Records {
 public:
  template <typename Fill>
  void add(Op op, Fill&& fill) {
    u8(static_cast<std::uint8_t>(op));
    const std::size_t length = bytes_.size();
    u64(0);
    fill(*this);
    const std::uint64_t content = bytes_.size() - length - sizeof(std::uint64_t);
    std::memcpy(bytes_.data() + length, &content, sizeof(content));
  }
  void u8(std::uint8_t value) { put(value); }
  void u16(std::uint16_t value) { put(value); }
  void u32(std::uint32_t value) { put(value); }
  void u64(std::uint64_t value) { put(value); }
  void text(std::string_view text) {
    u32(static_cast<std::uint32_t>(text.size()));
    bytes_.insert(bytes_.end(), text.begin(), text.end());
  }
  void copy(Bytes bytes) { bytes_.insert(bytes_.end(), bytes.begin(), bytes.end()); }
  void clear() { bytes_.clear(); }
  [[nodiscard]] std::size_t size() const { return bytes_.size(); }
  [[nodiscard]] Bytes bytes() const { return bytes_; }

 private:
  template <typename T>
  void put(T value) {
    static_assert(std::endian::native == std::endian::little, "numbers are copied as they are");
    const auto word = std::bit_cast<std::array<std::uint8_t, sizeof(T)>>(value);
    bytes_.insert(bytes_.end(), word.begin(), word.end());
  }

  std::vector<std::uint8_t> bytes_;
};

class McapWriter final : public BagWriter {
 public:
  McapWriter(const std::string& path, McapPacking packing)
      : BagWriter(path), packing_(packing), file_(std::fopen(path.c_str(), "wbe")) {
    if (!file_) fail();
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
    if (std::fclose(file_.release()) != 0) fail();
  }

 private:
  struct FileCloser {
    void operator()(std::FILE* file) const { std::fclose(file); }
  };
  struct Channel {
    Records index;  ///< of the chunk being filled
    std::uint64_t messages = 0;
  };

  [[noreturn]] void fail() const {
    throw InputError(path_, 0, "", std::string("cannot be written: ") + std::strerror(errno),
                     "Check that the folder exists and is writable and the disk is not full");
  }

  void write(Bytes bytes) {
    if (std::fwrite(bytes.data(), 1, bytes.size(), file_.get()) != bytes.size()) fail();
    crc_ = crcOf(crc_, bytes);
    at_ += bytes.size();
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
    const std::uint64_t begin = at_;
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
    const std::uint64_t length = at_ - begin;
    Records offsets;
    for (std::size_t id = 0; id < channels_.size(); ++id) {
      Records& index = channels_[id].index;
      if (index.size() == 0) continue;
      offsets.u16(static_cast<std::uint16_t>(id));
      offsets.u64(at_ + records_.size());
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
    const std::uint64_t begin = at_;
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
  std::unique_ptr<std::FILE, FileCloser> file_;
  std::uint64_t at_ = 0;   ///< bytes written
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
