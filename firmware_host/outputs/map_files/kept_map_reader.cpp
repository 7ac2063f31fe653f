#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <istream>
#include <memory>
#include <optional>
#include <vector>

#include "drivers/device/byte_fields.hpp"
#include "drivers/input/input_error.hpp"
#include "drivers/recorded/recording_checksum.hpp"
#include "firmware_host/outputs/map_files/kept_map_format.hpp"
#include "mapping/map/kept_submaps.hpp"

namespace swiftlet {
namespace {

using namespace kept;  // NOLINT(google-build-using-namespace)

constexpr const char* kOtherCopy = "Use another copy of the file, or start a new map. Nothing was loaded";

struct ReadBlock : StoredBlock {
  std::uint8_t sides = 0;
  float drift = 0;
};

/// Receives the content of a file in its order. This base class ignores it, so that the reader only checks
/// the file.
class MapTaker {
 public:
  virtual ~MapTaker() = default;
  virtual void block(ReadBlock& /*block*/) {}
  virtual void freeBlock(ReadBlock& /*block*/) {}
};

/// One pass over a file: each record is read completely, its checksum and then its values are checked, and it
/// is handed over.
class MapReader {
 public:
  MapReader(const std::string& name, std::istream& in)
      : name_(name), in_(in), bytes_(kRecordBytes + kMostPayload), block_(std::make_unique<ReadBlock>()) {
    in_.clear();
    in_.seekg(0, std::ios::end);
    size_ = in_ ? static_cast<std::uint64_t>(in_.tellg()) : 0;
    in_.seekg(0);
    readHead();
  }

  [[nodiscard]] const Head& head() const { return head_; }
  void demandSettings(const VolumeSettings& settings) const;
  void walk(MapTaker& taker);

 private:
  [[noreturn]] void refuse(std::uint64_t offset, const std::string& field, const std::string& message) const {
    throw InputError(name_, 0, fmt::format("byte {}: {}", offset, field), message, kOtherCopy);
  }
  void demand(bool holds, std::uint64_t offset, const char* field, const char* message) const {
    if (!holds) refuse(offset, field, message);
  }
  void fetch(std::size_t at, std::size_t count, const char* field);
  void readHead();
  Kind readRecord();
  void readBlock(MapTaker& taker);
  void readFree(MapTaker& taker);
  /// Position in the file of a part of the current payload.
  [[nodiscard]] std::uint64_t at(std::size_t in_payload) const { return record_ + kRecordBytes + in_payload; }
  BlockIndex readIndex(LittleFieldReader& from, std::size_t in_payload);
  [[nodiscard]] LittleFieldReader payload() const {
    return LittleFieldReader({bytes_.data() + kRecordBytes, length_});
  }

  const std::string& name_;
  std::istream& in_;
  std::uint64_t size_ = 0;
  std::uint64_t next_ = 0;    ///< next byte to read
  std::uint64_t record_ = 0;  ///< first byte of the current record
  std::size_t length_ = 0;    ///< of the current payload
  std::vector<std::uint8_t> bytes_;
  std::uint32_t version_ = 0;
  Head head_;
  BlockIndex vehicle_;
  std::uint32_t head_crc_ = 0;
  std::optional<Nearness> last_;  ///< of the current kind of record
  KeptMapCounts found_;
  std::unique_ptr<ReadBlock> block_;
};

void MapReader::fetch(std::size_t at, std::size_t count, const char* field) {
  if (count > size_ - next_) {
    refuse(record_, field,
           fmt::format("the file ends at byte {}, but {} bytes are needed from byte {} on", size_, count,
                       next_));
  }
  in_.read(reinterpret_cast<char*>(bytes_.data() + at), static_cast<std::streamsize>(count));
  if (!in_) refuse(record_, field, "cannot be read");
  next_ += count;
}

void MapReader::readHead() {
  fetch(0, kHeadBytes, "head");
  LittleFieldReader from({bytes_.data(), kHeadBytes});
  const auto magic = from.bytes(kMagic.size());
  if (!std::equal(magic.begin(), magic.end(), kMagic.begin())) {
    throw InputError(name_, 0, "byte 0: magic", "this is not a map kept by swiftlet",
                     "Give a file written by --keep, or a folder written by --keep-map with --map");
  }
  constexpr std::size_t kVersionAt = 8, kSizeAt = 12;
  version_ = from.u32();
  const std::uint32_t bytes = from.u32();
  head_crc_ = crc32c(0, {bytes_.data(), kHeadCrcAt});
  const bool sound = head_crc_ == LittleFieldReader({bytes_.data() + kHeadCrcAt, sizeof(head_crc_)}).u32();
  demand(sound, 0, "head's checksum", "does not match the data: the file is damaged");
  if (version_ < kVersionOfWholeBlocks || version_ > kVersion) {
    throw InputError(
        name_, 0, fmt::format("byte {}: version", kVersionAt),
        fmt::format("is {}, this program reads {} to {}", version_, kVersionOfWholeBlocks, kVersion),
        "Use the program that kept the map, or start a new one");
  }
  demand(bytes == kHeadBytes, kSizeAt, "head's length", "does not fit this version");
  head_.voxel_size = from.f64();
  head_.truncation = from.f64();
  head_.reference_sigma = from.f64();
  const std::uint32_t flags = from.u32();
  head_.labels = (flags & kHasLabels) != 0;
  head_.epoch = from.u32();
  head_.counts.blocks = from.u32();
  head_.counts.free_blocks = from.u32();
  const float least_weight = from.f32();
  if (version_ > kVersionWithPatches) head_.least_weight = least_weight;
  const std::uint32_t side = from.u32();
  for (int axis = 0; axis < 3; ++axis) head_.p_map_vehicle[axis] = from.f64();
  constexpr std::size_t kSettingsAt = 16, kFlagsAt = 40, kLeastWeightAt = 56, kSideAt = 60, kVehicleAt = 64,
                        kZeroAt = 88;
  const auto sane = [](double x) { return std::isfinite(x) && x > 0; };
  demand(sane(head_.voxel_size) && sane(head_.truncation) && sane(head_.reference_sigma), kSettingsAt,
         "settings", "are not positive");
  demand((flags & ~kHasLabels) == 0, kFlagsAt, "flags", "has bits unknown to this version");
  demand(std::isfinite(head_.least_weight) && head_.least_weight > 0, kLeastWeightAt, "least weight",
         "is not positive");
  demand(side == static_cast<std::uint32_t>(kBlockSide), kSideAt, "voxels along a block",
         "do not fit this version");
  demand(head_.p_map_vehicle.allFinite(), kVehicleAt, "vehicle", "is not finite");
  demand(from.u32() == 0, kZeroAt, "head", "has bytes unknown to this version");
  vehicle_ = vehicleBlock(head_);
}

void MapReader::demandSettings(const VolumeSettings& settings) const {
  const auto differ = [&](const char* what, const std::string& kept, const std::string& wanted,
                          const std::string& remedy) {
    throw InputError(name_, 0, what,
                     fmt::format("the map was kept with {}, the settings have {}", kept, wanted), remedy);
  };
  const auto metres = [](double x) { return fmt::format("{:g} m", x); };
  if (head_.voxel_size != settings.voxel_size) {
    differ("voxel size", metres(head_.voxel_size), metres(settings.voxel_size),
           fmt::format("Use --set map.voxel_size={:g}, or a map with that voxel size", head_.voxel_size));
  }
  if (head_.truncation != settings.truncation) {
    differ("truncation distance", metres(head_.truncation), metres(settings.truncation),
           "Use the program that kept the map, or start a new one");
  }
  if (head_.reference_sigma != settings.reference_sigma) {
    differ("deviation of weight 1", metres(head_.reference_sigma), metres(settings.reference_sigma),
           "Use the program that kept the map, or start a new one");
  }
  if (head_.labels != settings.labels) {
    differ("labels", head_.labels ? "labels" : "no labels", settings.labels ? "labels" : "no labels",
           fmt::format("Use --set map.labels={}, or another map", head_.labels ? "true" : "false"));
  }
}

Kind MapReader::readRecord() {
  record_ = next_;
  fetch(0, kRecordBytes, "record's head");
  LittleFieldReader from({bytes_.data(), kRecordBytes});
  constexpr std::size_t kCrc = sizeof(std::uint32_t), kLengthAt = 8;
  const std::uint32_t stated = from.u32();
  const std::uint16_t kind = from.u16();
  const std::uint16_t zero = from.u16();
  const std::uint32_t length = from.u32();
  demand(length <= kMostPayload, record_ + kLengthAt, "record's length", "is too large: the file is damaged");
  fetch(kRecordBytes, length, "record");
  const std::uint32_t crc = crc32c(head_crc_, {bytes_.data() + kCrc, kRecordBytes - kCrc + length});
  demand(crc == stated, record_, "record's checksum", "does not match the data: the file is damaged");
  const Kind last = version_ <= kVersionWithPatches ? Kind::kPatch : Kind::kFree;
  demand(zero == 0 && kind <= static_cast<std::uint16_t>(last), record_ + kCrc, "record's kind",
         "is unknown to this version");
  length_ = length;
  return static_cast<Kind>(kind);
}

BlockIndex MapReader::readIndex(LittleFieldReader& from, std::size_t in_payload) {
  BlockIndex index;
  index.x = from.i32();
  index.y = from.i32();
  index.z = from.i32();
  demand(index.inRange(), at(in_payload), "block", "lies outside a map's range");
  const Nearness now = nearness(index, vehicle_);
  demand(!last_ || *last_ < now, at(in_payload), "block",
         "is not farther from the vehicle than the block before it");
  last_ = now;
  return index;
}

void MapReader::walk(MapTaker& taker) {
  const auto order = [](Kind kind) { return kind == Kind::kEnd ? 4 : static_cast<int>(kind); };
  Kind before = Kind::kBlock;
  for (Kind kind = readRecord(); kind != Kind::kEnd; kind = readRecord()) {
    demand(order(kind) >= order(before), record_, "record's kind", "is out of order");
    if (kind != before) last_.reset();
    before = kind;
    if (kind == Kind::kBlock) readBlock(taker);
    if (kind == Kind::kFree) readFree(taker);
  }
  demand(length_ == 0, record_, "end's length", "is not zero");
  const KeptMapCounts& held = head_.counts;
  demand(found_.blocks == held.blocks && found_.free_blocks == held.free_blocks, record_, "end",
         "is at the wrong place for the number of blocks in the head");
  demand(next_ == size_, next_, "end", "is followed by extra bytes");
}

void MapReader::readBlock(MapTaker& taker) {
  demand(length_ == kBlockBytes + (head_.labels ? kLabelBytes : 0), record_, "block's length",
         "does not match a block");
  LittleFieldReader from = payload();
  ReadBlock& block = *block_;
  block.index = readIndex(from, 0);
  block.sides = from.u8();
  const auto zeros = from.bytes(3);
  block.free_parts = 0;
  demand(block.sides <= (BlockHeader::kInFront | BlockHeader::kBehind) &&
             std::ranges::all_of(zeros, [](std::uint8_t b) { return b == 0; }),
         at(kIndexBytes), "sides", "are invalid");
  block.drift = from.f32();
  demand(std::isfinite(block.drift) && block.drift >= 0, at(kIndexBytes + 4), "drift", "is not a length");
  constexpr std::size_t kDistancesAt = kIndexBytes + 8;
  for (std::size_t i = 0; i < kBlockVoxels; ++i) {
    block.voxels.distance[i] = static_cast<std::int16_t>(from.u16());
    demand(block.voxels.distance[i] != std::numeric_limits<std::int16_t>::min(), at(kDistancesAt + 2 * i),
           "distance", "is beyond the truncation distance");
  }
  for (std::uint16_t& weight : block.voxels.weight) weight = from.u16();
  std::ranges::copy(from.bytes(kBlockVoxels), block.voxels.grey.begin());
  for (std::size_t i = 0; head_.labels && i < kBlockVoxels; ++i) {
    LabelCounts::Words words{};
    for (std::uint16_t& word : words) word = from.u16();
    demand(block.labels.counts[i].setWords(words), at(kBlockBytes + sizeof(words) * i), "label counts",
           "are not in descending order");
  }
  block.setLabels(head_.labels ? &block.labels : nullptr);
  ++found_.blocks;
  taker.block(block);
}

void MapReader::readFree(MapTaker& taker) {
  const bool whole_blocks = version_ == kVersionOfWholeBlocks;
  const std::size_t each = whole_blocks ? kFreeBytesOfWholeBlocks : kFreeBytes;
  demand(length_ > 0 && length_ % each == 0, record_, "free blocks' length", "does not match its content");
  LittleFieldReader from = payload();
  ReadBlock& block = *block_;
  block.has_labels = false;
  for (std::size_t i = 0; i < length_; i += each) {
    block.index = readIndex(from, i);
    block.free_parts = kAllParts;
    if (whole_blocks) {
      const std::uint16_t images = from.u16();
      demand(images > 0 && from.u16() == 0, at(i + kIndexBytes), "images that saw it free", "are invalid");
    } else {
      block.free_parts = from.u64();
      demand(block.free_parts != 0, at(i + kIndexBytes), "free parts", "are invalid");
    }
    ++found_.free_blocks;
    taker.freeBlock(block);
  }
}

/// Loads into an empty volume. Later blocks are farther away; when the volume is full they go to the submaps.
class Loader final : public MapTaker {
 public:
  Loader(VoxelVolume& volume, MapSubmaps* submaps, const Eigen::Vector3d& p_map_vehicle,
         KeptMapReport& report)
      : volume_(volume), submaps_(submaps), vehicle_(p_map_vehicle.cast<float>()), report_(report) {}

  void block(ReadBlock& block) override {
    const bool room = volume_.blockCount() < volume_.blockCapacity();
    const std::uint32_t slot = room ? volume_.obtain(block.index) : VoxelVolume::kNone;
    if (slot == VoxelVolume::kNone) {
      withoutRoom(block, report_.without_room.blocks);
      return;
    }
    volume_.markChanged(slot);
    BlockHeader& header = volume_.changeHeader(slot);
    header.sides = block.sides;
    header.drift = block.drift;
    header.observed = true;
    volume_.changeVoxels(slot) = block.voxels;
    if (LabelBlock* labels = volume_.changeLabels(slot); labels != nullptr) *labels = block.labels;
  }
  void freeBlock(ReadBlock& block) override {
    const bool room = volume_.freeCount() < volume_.freeCapacity();
    if (room && volume_.find(block.index) == VoxelVolume::kNone)
      volume_.addFree(block.index, block.free_parts, vehicle_);
    if (volume_.find(block.index) == VoxelVolume::kNone) withoutRoom(block, report_.without_room.free_blocks);
  }

 private:
  void withoutRoom(StoredBlock& block, std::uint32_t& count) {
    if (submaps_ == nullptr) {
      ++count;
      return;
    }
    block.submap = submaps_->submaps().newest();
    submaps_->store(block);
  }

  VoxelVolume& volume_;
  MapSubmaps* submaps_;  ///< null: blocks without room are only counted
  Eigen::Vector3f vehicle_;
  KeptMapReport& report_;
};

std::ifstream opened(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  if (!in)
    throw InputError(path, 0, "", "cannot be opened",
                     "Give a file written by --keep, or a folder written by --keep-map with --map");
  return in;
}

/// Settings of a volume with enough memory for the whole map.
VolumeSettings settingsOf(const Head& head) {
  VolumeSettings settings;
  settings.voxel_size = head.voxel_size;
  settings.truncation = head.truncation;
  settings.reference_sigma = head.reference_sigma;
  settings.labels = head.labels;
  const std::size_t blocks =
      std::max<std::size_t>(head.counts.blocks, head.counts.free_blocks / VoxelVolume::kFreePerBlock + 1);
  settings.memory_bytes = VoxelVolume::bytesFor(blocks, settings.labels);
  return settings;
}

}  // namespace

KeptMapReport checkKeptMap(const std::string& name, std::istream& in, const VolumeSettings& settings) {
  MapReader reader(name, in);
  reader.demandSettings(settings);
  MapTaker nobody;
  reader.walk(nobody);
  return {reader.head().counts, {}, reader.head().epoch, reader.head().p_map_vehicle};
}

void loadKeptMap(const std::string& name, std::istream& in, VoxelVolume& volume, MapSubmaps* submaps,
                 KeptMapReport& report) {
  MapReader reader(name, in);
  reader.demandSettings(volume.settings());
  volume.beginChange();
  Loader loader(volume, submaps, reader.head().p_map_vehicle, report);
  reader.walk(loader);
}

KeptMapReport readKeptMap(const std::string& name, std::istream& in, MapStage& map) {
  KeptMapReport report = checkKeptMap(name, in, map.volume().settings());
  try {
    map.restore(report.epoch, report.p_map_vehicle, [&](VoxelVolume& volume, MapSubmaps& submaps) {
      loadKeptMap(name, in, volume, &submaps, report);
    });
  } catch (const InputError&) {
    map.restore(0, Eigen::Vector3d::Zero(), [](VoxelVolume& /*volume*/, MapSubmaps& /*submaps*/) {});
    throw;
  }
  return report;
}

KeptMapReport readKeptMapFile(const std::string& path, MapStage& map) {
  std::ifstream in = opened(path);
  return readKeptMap(path, in, map);
}

void checkKeptMapFile(const std::string& path, const VolumeSettings& settings) {
  std::ifstream in = opened(path);
  static_cast<void>(checkKeptMap(path, in, settings));
}

void readKeptSubmaps(const std::string& path, MapSubmaps& to, std::span<const WorldInMap> nodes) {
  struct IntoSubmaps : MapTaker {
    IntoSubmaps(MapSubmaps& s, std::span<const WorldInMap> n) : submaps(s, n) {}
    void block(ReadBlock& block) override { submaps.take(block); }
    void freeBlock(ReadBlock& block) override { submaps.take(block); }
    KeptSubmaps submaps;
  };
  if (nodes.empty()) return;
  std::ifstream in = opened(path);
  const std::uint64_t lost_before = to.stored().lost();
  IntoSubmaps taker(to, nodes);
  MapReader(path, in).walk(taker);
  if (const std::uint64_t lost = to.stored().lost() - lost_before; lost > 0) {
    throw InputError(path, 0, "", fmt::format("{} of its blocks cannot be stored in the output folder", lost),
                     "Free space on its disk, or fly without --map");
  }
}

KeptMapSettings keptMapSettings(const std::string& path) {
  std::ifstream in = opened(path);
  const MapReader reader(path, in);
  return {settingsOf(reader.head()), reader.head().least_weight};
}

VoxelVolume readKeptVolumeFile(const std::string& path) {
  std::ifstream in = opened(path);
  MapTaker nobody;
  MapReader checker(path, in);
  checker.walk(nobody);
  MapReader reader(path, in);
  VoxelVolume volume(settingsOf(checker.head()));
  volume.beginChange();
  KeptMapReport report;
  Loader loader(volume, nullptr, reader.head().p_map_vehicle, report);
  reader.walk(loader);
  if (report.without_room.blocks + report.without_room.free_blocks > 0) {
    throw InputError(path, 0, "", "blocks of the map do not fit into the volume's index",
                     "Keep the map again");
  }
  return volume;
}

}  // namespace swiftlet
