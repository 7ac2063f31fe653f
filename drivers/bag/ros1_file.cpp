#include "drivers/bag/ros1_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>

#include "drivers/bag/chunked_bag.hpp"
#include "drivers/bag/ros1_records.hpp"
#include "drivers/bag/ros_messages.hpp"
#include "drivers/input/input_error.hpp"

namespace swiftlet {
namespace ros1 {
namespace {

constexpr std::uint32_t kMostHeader = std::uint32_t{1} << 16U;  // bytes; the longest field is a topic's name
constexpr std::size_t kIndexEntry = 12;                         // bytes: time and offset

Stamp readTime(LittleFieldReader& reader) {
  const std::int64_t seconds = reader.u32();
  return Stamp{seconds * rosmsg::kNsPerSecond + reader.u32()};
}

class File final : public ChunkedBag {
 public:
  File(const std::string& path, const std::string& name);
  Bytes read(const BagEntry& entry) override;

 private:
  /// Number in the header of the record at `place`.
  std::uint32_t numberOf(Bytes header, const char* name, std::uint64_t place) const;
  /// Its bytes are valid until the next call to file_.at().
  Head headAt(std::uint64_t at, std::uint64_t end);
  void readBagRecord();
  void readTail();
  void walk();
  bool mayEndIn(std::uint64_t at);
  void takeRecord(const Head& head, std::uint64_t at);
  void takeConnection(Bytes header, Bytes data, std::uint64_t place);
  void takeChunk(const Head& head, std::uint64_t at);
  void takeIndex(const Head& head, std::uint64_t at);
  BagEntry entryOf(Bytes header, std::uint32_t part, std::uint64_t at, std::uint64_t place) const;
  void scanChunk(std::uint32_t chunk, bool messages) override;

  std::uint64_t data_end_ = 0;  ///< byte where the tail begins; the file's end if it was not closed
  bool finished_ = false;       ///< the tail is complete
  std::uint32_t chunk_count_ = 0;
  std::uint64_t count_ = 0;                             ///< number of messages by the tail
  std::map<std::uint32_t, std::uint32_t> connections_;  ///< indexes of topics
};

File::File(const std::string& path, const std::string& name) : ChunkedBag(path, name, "rosbag reindex") {
  readBagRecord();
  if (finished_) readTail();
  walk();
  if (finished_ && count_ != entries_.size()) {
    fail(data_end_, fmt::format("it counts {} messages, but holds {}", count_, entries_.size()));
  }
  orderEntries();
}

std::uint32_t File::numberOf(Bytes header, const char* name, std::uint64_t place) const {
  const std::optional<std::uint32_t> value = number(header, name);
  if (!value) fail(place, fmt::format("a record's field {} is missing or damaged", name));
  return *value;
}

Head File::headAt(std::uint64_t at, std::uint64_t end) {
  const std::uint32_t length = LittleFieldReader(file_.at(at, sizeof(std::uint32_t))).u32();
  if (length > kMostHeader) fail(at, "a record's header is damaged");
  const Head head = headOf(file_.at(at, length + 2 * sizeof(std::uint32_t)));
  if (head.op == Op{}) fail(at, "a record's header is damaged");
  if (at + head.size > end || head.length > end - at - head.size) fail(at, "a record extends past the data");
  return head;
}

void File::readBagRecord() {
  const std::uint64_t at = kMagic.size();
  if (textOf(file_.at(0, at)) != kMagic) fail(0, "is not a ROS 1 bag of format 2.0");
  const Head head = headAt(at, file_.size());
  if (head.op != Op::kBag) fail(at, "does not begin with a bag's header");
  if (const auto encryptor = field(head.header, "encryptor"); encryptor && !encryptor->empty()) {
    throw InputError(path_, 0, fmt::format("byte {}", at),
                     fmt::format("is encrypted with {}", textOf(*encryptor)),
                     "Decrypt it with `rosbag decrypt`");
  }
  const std::optional<Bytes> index = field(head.header, "index_pos");
  if (!index || index->size() != sizeof(std::uint64_t)) fail(at, "the bag's header has no field index_pos");
  data_end_ = LittleFieldReader(*index).u64();
  chunk_count_ = numberOf(head.header, "chunk_count", at);
  finished_ = data_end_ != 0 && data_end_ <= file_.size();
  if (!finished_) data_end_ = file_.size();
}

/// The connections again, so that the index of a chunk can be read without the chunk, and the chunks' counts.
void File::readTail() {
  constexpr std::size_t kCount = 8;  // bytes: connection and number of messages
  std::uint32_t infos = 0;
  try {
    for (std::uint64_t at = data_end_; at < file_.size();) {
      const Head head = headAt(at, file_.size());
      if (head.op == Op::kConnection) takeRecord(head, at);
      if (head.op == Op::kChunkInfo) {
        ++infos;
        LittleFieldReader counts(file_.at(at + head.size, head.length));
        while (counts.left() >= kCount) {
          counts.skip(sizeof(std::uint32_t));
          count_ += counts.u32();
        }
      }
      at += head.size + head.length;
    }
    finished_ = infos == chunk_count_;
  } catch (const InputError&) {
    finished_ = false;
  }
  if (!finished_) data_end_ = file_.size();
}

void File::walk() {
  std::uint64_t at = kMagic.size();
  try {
    while (at < data_end_) {
      const Head head = headAt(at, data_end_);
      const std::uint64_t next = at + head.size + head.length;
      takeRecord(head, at);
      at = next;
    }
    if (finished_) closeChunk();
  } catch (const InputError&) {
    if (finished_ || !mayEndIn(at)) throw;
  }
  if (!finished_) endEarly(at);
}

/// Whether the record at `at` is the one that a recorder was writing when it ended; else it is damaged.
bool File::mayEndIn(std::uint64_t at) {
  // A compressed chunk gets its length when it is complete.
  if (chunkIsOpen() && chunks_.back().packed == 0 && chunks_.back().packing != Packing::kNone) return true;
  // After a power cut, zeros stand where bytes were not written.
  constexpr std::size_t kLengths = 2 * sizeof(std::uint32_t);
  for (const std::uint64_t place : {at, file_.size() - kLengths}) {
    if (std::ranges::all_of(file_.at(place, kLengths), [](std::uint8_t byte) { return byte == 0; }))
      return true;
  }
  const std::uint32_t header = LittleFieldReader(file_.at(at, sizeof(std::uint32_t))).u32();
  if (header > kMostHeader) return false;
  const Bytes bytes = file_.at(at, header + kLengths);
  return bytes.size() < header + kLengths || headOf(bytes).length > file_.size() - at - bytes.size();
}

void File::takeRecord(const Head& head, std::uint64_t at) {
  if (head.op != Op::kIndex) closeChunk();
  switch (head.op) {
    case Op::kConnection: {
      const Bytes record = file_.at(at, head.size + head.length);
      takeConnection(headOf(record).header, record.subspan(head.size), at);
      break;
    }
    case Op::kChunk:
      takeChunk(head, at);
      break;
    case Op::kIndex:
      takeIndex(head, at);
      break;
    case Op::kMessage:  // of a chunk that was being written when the recorder ended
      entries_.push_back(entryOf(head.header, kNoChunk, at, at));
      break;
    default:
      break;
  }
}

void File::takeConnection(Bytes header, Bytes data, std::uint64_t place) {
  const std::uint32_t id = numberOf(header, "conn", place);
  const auto name = field(header, "topic");
  const auto type = field(data, "type");
  if (!name || !type) fail(place, "a connection is damaged");
  const auto definition = field(data, "message_definition");
  const std::uint32_t topic =
      topicOf(textOf(*name), textOf(*type), BagEncoding::kRos1, textOf(definition.value_or(Bytes{})));
  const auto [known, added] = connections_.emplace(id, topic);
  if (!added && known->second != topic) {
    fail(place, fmt::format("connection {} is defined twice, for {} and for {}", id,
                            topics_[known->second].name, topics_[topic].name));
  }
}

void File::takeChunk(const Head& head, std::uint64_t at) {
  Chunk chunk;
  chunk.record = at;
  chunk.data = at + head.size;
  chunk.packed = head.length;
  chunk.unpacked = numberOf(head.header, "size", at);
  const std::string_view packing = textOf(field(head.header, "compression").value_or(Bytes{}));
  if (packing == "bz2") {
    chunk.packing = Packing::kBz2;
  } else if (packing == "lz4") {
    chunk.packing = Packing::kLz4;
  } else if (packing != "none") {
    fail(at, fmt::format("a chunk is compressed with `{}`, which is none of none, bz2 and lz4", packing));
  }
  beginChunk(chunk);
}

void File::takeIndex(const Head& head, std::uint64_t at) {
  const std::uint32_t connection = numberOf(head.header, "conn", at);
  const bool known_version = numberOf(head.header, "ver", at) == kIndexVersion;
  const std::uint64_t count = numberOf(head.header, "count", at);
  if (!known_version || !chunkIsOpen() || count * kIndexEntry != head.length)
    fail(at, "a chunk's index is damaged");
  if (count == 0) return;
  const std::uint32_t chunk = newestChunk();
  if (!connections_.contains(connection)) scanChunk(chunk, false);
  const auto known = connections_.find(connection);
  if (known == connections_.end()) {
    fail(at, fmt::format("a chunk's index names connection {}, which does not exist", connection));
  }
  LittleFieldReader reader(file_.at(at + head.size, head.length));
  while (reader.left() > 0) {
    const Stamp time = readTime(reader);
    const std::uint32_t offset = reader.u32();
    if (offset >= chunks_[chunk].unpacked) fail(at, "a chunk's index points outside of it");
    entries_.push_back({time, known->second, chunk, offset});
  }
}

BagEntry File::entryOf(Bytes header, std::uint32_t part, std::uint64_t at, std::uint64_t place) const {
  const std::uint32_t connection = numberOf(header, "conn", place);
  const auto known = connections_.find(connection);
  const auto time = field(header, "time");
  if (!time || time->size() != sizeof(std::uint64_t)) fail(place, "a message has no time");
  if (known == connections_.end()) {
    fail(place, fmt::format("a message of connection {}, which does not exist", connection));
  }
  LittleFieldReader reader(*time);
  return {readTime(reader), known->second, part, at};
}

void File::scanChunk(std::uint32_t chunk, bool messages) {
  const Bytes records = unpackedChunk(chunk);
  const std::uint64_t place = chunks_[chunk].record;
  for (std::size_t at = 0; at < records.size();) {
    const Head head = headOf(records.subspan(at));
    if (head.op == Op{} || head.length > records.size() - at - head.size) {
      fail(place, fmt::format("the record at {} of this chunk is damaged", at));
    }
    const Bytes data = records.subspan(at + head.size, head.length);
    if (head.op == Op::kConnection) takeConnection(head.header, data, place);
    if (head.op == Op::kMessage && messages) entries_.push_back(entryOf(head.header, chunk, at, place));
    at += head.size + head.length;
  }
}

Bytes File::read(const BagEntry& entry) {
  Bytes records;
  std::uint64_t place = entry.at;
  if (entry.part == kNoChunk) {
    const Head head = headAt(entry.at, data_end_);
    file_.read(entry.at, head.size + head.length, packed_);
    records = packed_;
  } else {
    records = unpackedChunk(entry.part);
    records = records.subspan(std::min<std::size_t>(entry.at, records.size()));
    place = chunks_[entry.part].record;
  }
  Head head = headOf(records);
  // rosbag's index may point to the connection that its first message follows.
  while (head.op == Op::kConnection && head.length <= records.size() - head.size) {
    records = records.subspan(head.size + head.length);
    head = headOf(records);
  }
  const bool fits = head.op == Op::kMessage && head.length <= records.size() - head.size;
  const BagEntry found = fits ? entryOf(head.header, entry.part, entry.at, place) : BagEntry{};
  if (!fits || found.topic != entry.topic || found.log_time != entry.log_time) {
    fail(place, "a chunk's index does not point to its message");
  }
  return records.subspan(head.size, head.length);
}

}  // namespace
}  // namespace ros1

std::unique_ptr<BagFile> openRos1File(const std::string& path, const std::string& name) {
  return std::make_unique<ros1::File>(path, name);
}

}  // namespace swiftlet
