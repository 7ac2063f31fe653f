#include "drivers/bag/mcap_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>

#include "drivers/bag/chunked_bag.hpp"
#include "drivers/bag/mcap_records.hpp"
#include "drivers/device/byte_fields.hpp"
#include "drivers/input/input_error.hpp"
#include "drivers/input/stamp_range.hpp"

namespace swiftlet {
namespace {

using Bytes = std::span<const std::uint8_t>;
using mcap::crcOf;
using mcap::Op;

std::string_view textOf(Bytes bytes) { return {reinterpret_cast<const char*>(bytes.data()), bytes.size()}; }

std::string_view readText(LittleFieldReader& reader) { return textOf(reader.bytes(reader.u32())); }

BagEncoding encodingOf(std::string_view message_encoding) {
  if (message_encoding == "cdr") return BagEncoding::kCdr;
  return message_encoding == "ros1" ? BagEncoding::kRos1 : BagEncoding::kOther;
}

class McapFile final : public ChunkedBag {
 public:
  McapFile(const std::string& path, const std::string& name);
  Bytes read(const BagEntry& entry) override;

 private:
  struct Schema {
    std::string name;
    std::string definition;
  };
  struct Channel {
    std::uint16_t schema = 0;
    std::string topic;
    std::string encoding;
    std::uint32_t index = 0;  ///< of the topic
    bool operator==(const Channel&) const = default;
  };
  void findEnd();
  void readSummary();
  void walk();
  /// Takes the record at `at` and moves there to the next; false: it was the last.
  bool takeRecord(std::uint64_t& at);
  void endData(std::uint64_t at);
  void checkData(std::uint64_t data_end, std::uint32_t crc);
  void takeSchema(Bytes content, std::uint64_t place);
  void takeChannel(Bytes content, std::uint64_t place);
  void takeStatistics(Bytes content, std::uint64_t place);
  void takeChunk(std::uint64_t record, std::uint64_t content, std::uint64_t length);
  void takeIndex(Bytes content, std::uint64_t place);
  void scanChunk(std::uint32_t chunk, bool messages) override;
  void takeMessage(Bytes head, std::uint32_t part, std::uint64_t at, std::uint64_t place);
  [[nodiscard]] Stamp stampOf(std::uint64_t ns, std::uint32_t topic, std::uint64_t place) const;

  bool finished_ = false;      ///< footer and magic are present at the end
  bool zero_tail_ = false;     ///< zeros are present at the end, as after a power cut
  std::uint64_t footer_ = 0;   ///< byte where the footer begins
  std::uint64_t summary_ = 0;  ///< byte where the summary begins; 0: none
  bool counted_ = false;       ///< the summary has statistics
  std::uint64_t count_ = 0;    ///< number of messages in the statistics
  bool outside_ = false;       ///< some messages are outside of chunks
  std::map<std::uint16_t, Schema> schemas_;
  std::map<std::uint16_t, Channel> channels_;
  std::vector<std::uint8_t> message_;  ///< decompressed
};

McapFile::McapFile(const std::string& path, const std::string& name)
    : ChunkedBag(path, name, "mcap recover") {
  const Bytes magic = file_.at(0, mcap::kMagic.size());
  if (!std::equal(magic.begin(), magic.end(), mcap::kMagic.begin(), mcap::kMagic.end())) {
    fail(0, "is not an MCAP file");
  }
  findEnd();
  if (summary_ != 0) readSummary();
  walk();
  if (counted_ && count_ != entries_.size()) {
    fail(summary_, fmt::format("its statistics count {} messages, but it holds {}", count_, entries_.size()));
  }
  orderEntries();
}

void McapFile::findEnd() {
  const std::uint64_t end_size = mcap::kRecordHead + mcap::kFooterContent + mcap::kMagic.size();
  if (file_.size() < mcap::kMagic.size() + end_size) return;
  footer_ = file_.size() - end_size;
  const Bytes end = file_.at(footer_, end_size);
  LittleFieldReader reader(end);
  const bool footer =
      reader.u8() == static_cast<std::uint8_t>(Op::kFooter) && reader.u64() == mcap::kFooterContent;
  const Bytes magic = end.last(mcap::kMagic.size());
  zero_tail_ = std::ranges::all_of(magic, [](std::uint8_t byte) { return byte == 0; });
  if (!footer || !std::equal(magic.begin(), magic.end(), mcap::kMagic.begin())) return;
  finished_ = true;
  summary_ = reader.u64();
  if (summary_ != 0 && (summary_ < mcap::kMagic.size() || summary_ > footer_)) {
    fail(footer_, "the footer places the summary outside the file");
  }
}

void McapFile::readSummary() {
  constexpr std::uint64_t kCrc = 4;
  const std::uint64_t size = file_.size() - mcap::kMagic.size() - summary_;
  if (size > kMostUnpacked) fail(footer_, fmt::format("a summary of {} bytes is too large", size));
  std::vector<std::uint8_t> bytes;
  file_.read(summary_, static_cast<std::size_t>(size), bytes);
  if (bytes.size() != size) fail(summary_, "the file is truncated");
  const Bytes covered = Bytes(bytes).first(bytes.size() - kCrc);
  const std::uint32_t crc = LittleFieldReader(Bytes(bytes).last(kCrc)).u32();
  if (crc != 0 && crcOf(0, covered) != crc) fail(summary_, "the summary's checksum is wrong");
  LittleFieldReader reader(covered.first(static_cast<std::size_t>(footer_ - summary_)));
  while (reader.left() > 0) {
    const std::uint64_t place = footer_ - reader.left();
    const auto op = static_cast<Op>(reader.u8());
    const Bytes content = reader.bytes(static_cast<std::size_t>(reader.u64()));
    if (!reader.ok()) fail(place, "a record of the summary extends past its end");
    if (op == Op::kSchema) takeSchema(content, place);
    if (op == Op::kChannel) takeChannel(content, place);
    if (op == Op::kStatistics) takeStatistics(content, place);
  }
}

void McapFile::takeSchema(Bytes content, std::uint64_t place) {
  LittleFieldReader reader(content);
  const std::uint16_t id = reader.u16();
  Schema schema{std::string(readText(reader)), {}};
  const std::string_view encoding = readText(reader);
  const std::string_view text = readText(reader);
  if (!reader.ok() || id == 0) fail(place, "a schema is damaged");
  if (encoding == "ros2msg" || encoding == "ros1msg") schema.definition = text;
  const auto [known, added] = schemas_.emplace(id, schema);
  if (!added && known->second.name != schema.name) {
    fail(place,
         fmt::format("schema {} is defined twice, as {} and as {}", id, known->second.name, schema.name));
  }
}

void McapFile::takeChannel(Bytes content, std::uint64_t place) {
  LittleFieldReader reader(content);
  const std::uint16_t id = reader.u16();
  Channel channel;
  channel.schema = reader.u16();
  channel.topic = readText(reader);
  channel.encoding = readText(reader);
  if (!reader.ok()) fail(place, "a channel is damaged");
  if (const auto known = channels_.find(id); known != channels_.end()) {
    channel.index = known->second.index;
    if (channel == known->second) return;
    fail(place, fmt::format("channel {} is defined twice, for {} and for {}", id, known->second.topic,
                            channel.topic));
  }
  const auto schema = schemas_.find(channel.schema);
  if (schema == schemas_.end() && channel.schema != 0) {
    fail(place, fmt::format("channel {} names schema {}, which does not exist", id, channel.schema));
  }
  const Schema& type = schema == schemas_.end() ? Schema{} : schema->second;
  channel.index = topicOf(channel.topic, type.name, encodingOf(channel.encoding), type.definition);
  channels_.emplace(id, std::move(channel));
}

void McapFile::takeStatistics(Bytes content, std::uint64_t place) {
  LittleFieldReader reader(content);
  count_ = reader.u64();
  if (!reader.ok()) fail(place, "the statistics are damaged");
  counted_ = true;
}

void McapFile::endData(std::uint64_t at) {
  if (finished_) fail(at, "a record is damaged or extends past the data");
  endEarly(at);
}

void McapFile::walk() {
  std::uint64_t at = mcap::kMagic.size();
  try {
    while (takeRecord(at)) {
    }
  } catch (const InputError&) {
    if (!zero_tail_) throw;
    endData(at);
  }
}

bool McapFile::takeRecord(std::uint64_t& at) {
  const Bytes head = file_.at(at, mcap::kRecordHead);
  LittleFieldReader reader(head);
  const auto op = static_cast<Op>(reader.u8());
  const std::uint64_t length = reader.u64();
  const std::uint64_t content = at + mcap::kRecordHead;
  const std::uint64_t end = finished_ ? footer_ : file_.size();
  // No record is of kind 0: the zeros are bytes that were not written before a power cut.
  const bool ends = op == Op{} || (op == Op::kDataEnd && !finished_);
  if (!reader.ok() || content > end || length > end - content || ends) {
    endData(at);
    return false;
  }
  const auto small = static_cast<std::size_t>(length);
  if (op != Op::kMessageIndex) closeChunk();
  switch (op) {
    case Op::kSchema:
      takeSchema(file_.at(content, small), at);
      break;
    case Op::kChannel:
      takeChannel(file_.at(content, small), at);
      break;
    case Op::kMessage:
      outside_ = true;
      takeMessage(file_.at(content, std::min(small, mcap::kMessageHead)), kNoChunk, at, at);
      break;
    case Op::kChunk:
      takeChunk(at, content, length);
      break;
    case Op::kMessageIndex:
      takeIndex(file_.at(content, small), at);
      break;
    case Op::kDataEnd:
      if (content + length != (summary_ != 0 ? summary_ : footer_)) fail(at, "the data is truncated");
      checkData(at, LittleFieldReader(file_.at(content, small)).u32());
      return false;
    default:
      break;  // attachments, metadata and future kinds
  }
  at = content + length;
  return true;
}

void McapFile::checkData(std::uint64_t data_end, std::uint32_t crc) {
  if (crc == 0 || !outside_) return;
  std::uint32_t found = 0;
  constexpr std::uint64_t kPiece = std::uint64_t{1} << 20U;
  for (std::uint64_t at = 0; at < data_end; at += kPiece) {
    file_.read(at, static_cast<std::size_t>(std::min(kPiece, data_end - at)), packed_);
    found = crcOf(found, packed_);
  }
  if (found != crc) fail(data_end, "the checksum of the data is wrong");
}

void McapFile::takeChunk(std::uint64_t record, std::uint64_t content, std::uint64_t length) {
  constexpr std::size_t kMostHead = 64;  // bytes; the compression's name has at most 4
  LittleFieldReader reader(
      file_.at(content, static_cast<std::size_t>(std::min<std::uint64_t>(length, kMostHead))));
  Chunk chunk;
  chunk.record = record;
  reader.skip(2 * sizeof(std::uint64_t));  // first and last time
  chunk.unpacked = reader.u64();
  chunk.crc = reader.u32();
  const std::size_t before = reader.left();
  const std::string_view packing = readText(reader);
  chunk.packed = reader.u64();
  const std::uint64_t head = 2 * sizeof(std::uint64_t) + 12 + (before - reader.left());
  if (!reader.ok() || length < head || chunk.packed != length - head)
    fail(record, "a chunk's head is damaged");
  chunk.data = content + head;
  if (packing == "zstd") {
    chunk.packing = Packing::kZstd;
  } else if (packing == "lz4") {
    chunk.packing = Packing::kLz4;
  } else if (!packing.empty()) {
    fail(record, fmt::format("a chunk is compressed with `{}`, which is neither zstd nor lz4", packing));
  }
  beginChunk(chunk);
}

void McapFile::takeIndex(Bytes content, std::uint64_t place) {
  LittleFieldReader reader(content);
  const std::uint16_t channel = reader.u16();
  const std::uint32_t bytes = reader.u32();
  constexpr std::size_t kEntry = 16;
  if (!reader.ok() || !chunkIsOpen() || bytes != reader.left() || bytes % kEntry != 0) {
    fail(place, "a message index is damaged");
  }
  if (bytes == 0) return;
  const std::uint32_t chunk = newestChunk();
  if (!channels_.contains(channel)) scanChunk(chunk, false);
  const auto known = channels_.find(channel);
  if (known == channels_.end()) {
    fail(place, fmt::format("a message index names channel {}, which does not exist", channel));
  }
  while (reader.left() > 0) {
    const Stamp time = stampOf(reader.u64(), known->second.index, place);
    const std::uint64_t offset = reader.u64();
    if (offset >= chunks_[chunk].unpacked) fail(place, "a message index points outside its chunk");
    entries_.push_back({time, known->second.index, chunk, offset});
  }
}

Stamp McapFile::stampOf(std::uint64_t ns, std::uint32_t topic, std::uint64_t place) const {
  if (ns > static_cast<std::uint64_t>(kLargestStamp)) {
    fail(place, fmt::format("{}: the time {} ns is beyond the year 2096", topics_[topic].name, ns));
  }
  return Stamp{static_cast<std::int64_t>(ns)};
}

void McapFile::takeMessage(Bytes head, std::uint32_t part, std::uint64_t at, std::uint64_t place) {
  LittleFieldReader reader(head);
  const std::uint16_t id = reader.u16();
  reader.skip(sizeof(std::uint32_t));  // sequence
  const std::uint64_t time = reader.u64();
  if (!reader.ok()) fail(place, "a message is shorter than its head");
  const auto channel = channels_.find(id);
  if (channel == channels_.end())
    fail(place, fmt::format("a message of channel {}, which does not exist", id));
  entries_.push_back({stampOf(time, channel->second.index, place), channel->second.index, part, at});
}

void McapFile::scanChunk(std::uint32_t chunk, bool messages) {
  const Bytes records = unpackedChunk(chunk);
  const std::uint64_t place = chunks_[chunk].record;
  LittleFieldReader reader(records);
  while (reader.left() > 0) {
    const std::size_t at = records.size() - reader.left();
    const auto op = static_cast<Op>(reader.u8());
    const Bytes content = reader.bytes(static_cast<std::size_t>(reader.u64()));
    if (!reader.ok()) fail(place, fmt::format("the record at {} extends past the end of this chunk", at));
    if (op == Op::kSchema) takeSchema(content, place);
    if (op == Op::kChannel) takeChannel(content, place);
    if (op == Op::kMessage && messages) takeMessage(content, chunk, at, place);
  }
}

Bytes McapFile::read(const BagEntry& entry) {
  Bytes record;
  std::uint64_t place = entry.at;
  if (entry.part == kNoChunk) {
    const std::uint64_t length = LittleFieldReader(file_.at(entry.at + 1, sizeof(std::uint64_t))).u64();
    file_.read(entry.at, static_cast<std::size_t>(mcap::kRecordHead + length), packed_);
    record = packed_;
  } else {
    const Bytes records = unpackedChunk(entry.part);
    record = records.subspan(static_cast<std::size_t>(std::min<std::uint64_t>(entry.at, records.size())));
    place = chunks_[entry.part].record;
  }
  LittleFieldReader reader(record);
  const bool message = reader.u8() == static_cast<std::uint8_t>(Op::kMessage);
  const Bytes content = reader.bytes(static_cast<std::size_t>(reader.u64()));
  LittleFieldReader head(content);
  const auto channel = channels_.find(head.u16());
  head.skip(sizeof(std::uint32_t));  // sequence
  const std::uint64_t time = head.u64();
  head.skip(sizeof(std::uint64_t));  // time of publication
  if (!message || !reader.ok() || !head.ok() || channel == channels_.end() ||
      channel->second.index != entry.topic || time != static_cast<std::uint64_t>(entry.log_time.ns)) {
    fail(place, "the message index does not point to its message");
  }
  const Bytes body = head.bytes(head.left());
  // rosbag2 can compress single messages. CDR never begins like a zstd frame.
  if (topics_[entry.topic].encoding != BagEncoding::kCdr || !isZstd(body)) return body;
  if (!unpackZstd(body, kMostUnpacked, message_)) fail(place, "a message's zstd data is damaged");
  return message_;
}

}  // namespace

std::unique_ptr<BagFile> openMcapFile(const std::string& path, const std::string& name) {
  return std::make_unique<McapFile>(path, name);
}

}  // namespace swiftlet
