#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <fstream>
#include <istream>
#include <memory>
#include <optional>
#include <vector>

#include "drivers/calibration/input_error.hpp"
#include "drivers/recorded/recording_checksum.hpp"
#include "firmware_host/outputs/map_files/kept_map_format.hpp"

namespace swiftlet {
namespace {

using namespace kept;  // NOLINT(google-build-using-namespace)

constexpr const char* kOtherCopy = "Give another copy of the file, or begin a new map; nothing was loaded";

struct ReadBlock : StoredBlock {
  std::uint8_t sides = 0;
  float drift = 0;
};

/// Takes what a file holds, in its order; this one only lets the reader check it.
class MapTaker {
 public:
  virtual ~MapTaker() = default;
  virtual void block(ReadBlock& /*block*/) {}
  virtual void freeBlock(const BlockIndex& /*block*/, std::uint64_t /*parts*/) {}
  virtual void patch(const SurfacePatch& /*patch*/) {}
};

/// One pass over a file: each record is read whole, its checksum and then its values looked at, and given
/// away.
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
  void readPatch(MapTaker& taker);
  /// Of the payload in hand, where a part of it lies in the file.
  [[nodiscard]] std::uint64_t at(std::size_t in_payload) const { return record_ + kRecordBytes + in_payload; }
  BlockIndex readIndex(LittleEndianReader& from, std::size_t in_payload);
  [[nodiscard]] LittleEndianReader payload() const {
    return LittleEndianReader({bytes_.data() + kRecordBytes, length_});
  }

  const std::string& name_;
  std::istream& in_;
  std::uint64_t size_ = 0;
  std::uint64_t next_ = 0;    ///< byte to read
  std::uint64_t record_ = 0;  ///< first byte of the record in hand
  std::size_t length_ = 0;    ///< of its payload
  std::vector<std::uint8_t> bytes_;
  bool whole_blocks_ = false;  ///< kVersionOfWholeBlocks
  Head head_;
  BlockIndex vehicle_;
  std::uint32_t head_crc_ = 0;
  std::optional<Nearness> last_;  ///< of the kind in hand
  KeptMapCounts found_;
  std::unique_ptr<ReadBlock> block_;
  SurfacePatch patch_;
};

void MapReader::fetch(std::size_t at, std::size_t count, const char* field) {
  if (count > size_ - next_) {
    refuse(record_, field,
           fmt::format("the file ends at byte {}, {} are needed from byte {} on", size_, count, next_));
  }
  in_.read(reinterpret_cast<char*>(bytes_.data() + at), static_cast<std::streamsize>(count));
  if (!in_) refuse(record_, field, "cannot be read");
  next_ += count;
}

void MapReader::readHead() {
  fetch(0, kHeadBytes, "head");
  LittleEndianReader from({bytes_.data(), kHeadBytes});
  const auto magic = from.bytes(kMagic.size());
  if (!std::equal(magic.begin(), magic.end(), kMagic.begin())) {
    throw InputError(name_, 0, "byte 0: magic", "this is no map that swiftlet kept",
                     "Give a file that --keep wrote, or a folder that --keep-map wrote with --map");
  }
  constexpr std::size_t kVersionAt = 8, kSizeAt = 12;
  const std::uint32_t version = from.u32();
  const std::uint32_t bytes = from.u32();
  head_crc_ = crc32c(0, {bytes_.data(), kHeadCrcAt});
  const bool sound = head_crc_ == LittleEndianReader({bytes_.data() + kHeadCrcAt, sizeof(head_crc_)}).u32();
  demand(sound, 0, "head's checksum", "is not that of its bytes: the file is damaged");
  whole_blocks_ = version == kVersionOfWholeBlocks;
  if (version != kVersion && !whole_blocks_) {
    throw InputError(
        name_, 0, fmt::format("byte {}: version", kVersionAt),
        fmt::format("is {}, this program reads {} and {}", version, kVersionOfWholeBlocks, kVersion),
        "Use the program that kept the map, or begin a new one");
  }
  demand(bytes == kHeadBytes, kSizeAt, "head's length", "is not that of this version");
  head_.voxel_size = from.f64();
  head_.truncation = from.f64();
  head_.reference_sigma = from.f64();
  const std::uint32_t flags = from.u32();
  head_.labels = (flags & kHasLabels) != 0;
  head_.epoch = from.u32();
  head_.counts.blocks = from.u32();
  head_.counts.free_blocks = from.u32();
  head_.counts.patches = from.u32();
  const std::uint32_t side = from.u32();
  for (int axis = 0; axis < 3; ++axis) head_.p_map_vehicle[axis] = from.f64();
  constexpr std::size_t kSettingsAt = 16, kFlagsAt = 40, kSideAt = 60, kVehicleAt = 64, kZeroAt = 88;
  const auto sane = [](double x) { return std::isfinite(x) && x > 0; };
  demand(sane(head_.voxel_size) && sane(head_.truncation) && sane(head_.reference_sigma), kSettingsAt,
         "settings", "are not positive lengths");
  demand((flags & ~kHasLabels) == 0, kFlagsAt, "flags", "has bits that this version does not know");
  demand(side == static_cast<std::uint32_t>(kBlockSide), kSideAt, "voxels along a block",
         "are not those of this version");
  demand(head_.p_map_vehicle.allFinite(), kVehicleAt, "vehicle", "is not finite");
  demand(from.u32() == 0, kZeroAt, "head", "has bytes that this version does not know");
  vehicle_ = vehicleBlock(head_);
}

void MapReader::demandSettings(const VolumeSettings& settings) const {
  const auto differ = [&](const char* what, const std::string& kept, const std::string& wanted,
                          const std::string& remedy) {
    throw InputError(name_, 0, what,
                     fmt::format("the map was kept with {}, the settings say {}", kept, wanted), remedy);
  };
  const auto metres = [](double x) { return fmt::format("{:g} m", x); };
  if (head_.voxel_size != settings.voxel_size) {
    differ("voxel size", metres(head_.voxel_size), metres(settings.voxel_size),
           fmt::format("Continue it with --set map.voxel_size={:g}", head_.voxel_size));
  }
  if (head_.truncation != settings.truncation) {
    differ("truncation distance", metres(head_.truncation), metres(settings.truncation),
           "Use the program that kept the map, or begin a new one");
  }
  if (head_.reference_sigma != settings.reference_sigma) {
    differ("deviation of weight 1", metres(head_.reference_sigma), metres(settings.reference_sigma),
           "Use the program that kept the map, or begin a new one");
  }
  if (head_.labels != settings.labels) {
    differ("labels", head_.labels ? "labels" : "no labels", settings.labels ? "labels" : "no labels",
           fmt::format("Continue it with --set map.labels={}", head_.labels ? "true" : "false"));
  }
}

Kind MapReader::readRecord() {
  record_ = next_;
  fetch(0, kRecordBytes, "record's head");
  LittleEndianReader from({bytes_.data(), kRecordBytes});
  constexpr std::size_t kCrc = sizeof(std::uint32_t), kLengthAt = 8;
  const std::uint32_t stated = from.u32();
  const std::uint16_t kind = from.u16();
  const std::uint16_t zero = from.u16();
  const std::uint32_t length = from.u32();
  demand(length <= kMostPayload, record_ + kLengthAt, "record's length",
         "is more than any record has: the file is damaged");
  fetch(kRecordBytes, length, "record");
  const std::uint32_t crc = crc32c(head_crc_, {bytes_.data() + kCrc, kRecordBytes - kCrc + length});
  demand(crc == stated, record_, "record's checksum", "is not that of its bytes: the file is damaged");
  demand(zero == 0 && kind <= static_cast<std::uint16_t>(Kind::kPatch), record_ + kCrc, "record's kind",
         "is none that this version knows");
  length_ = length;
  return static_cast<Kind>(kind);
}

BlockIndex MapReader::readIndex(LittleEndianReader& from, std::size_t in_payload) {
  BlockIndex index;
  index.x = from.i32();
  index.y = from.i32();
  index.z = from.i32();
  demand(index.inRange(), at(in_payload), "block", "lies outside of what a map holds");
  const Nearness now = nearness(index, vehicle_);
  demand(!last_ || *last_ < now, at(in_payload), "block", "is not farther from the vehicle than that before");
  last_ = now;
  return index;
}

void MapReader::walk(MapTaker& taker) {
  const auto order = [](Kind kind) { return kind == Kind::kEnd ? 4 : static_cast<int>(kind); };
  Kind before = Kind::kBlock;
  for (Kind kind = readRecord(); kind != Kind::kEnd; kind = readRecord()) {
    demand(order(kind) >= order(before), record_, "record's kind", "comes after those that follow it");
    if (kind != before) last_.reset();
    before = kind;
    if (kind == Kind::kBlock) readBlock(taker);
    if (kind == Kind::kFree) readFree(taker);
    if (kind == Kind::kPatch) readPatch(taker);
  }
  demand(length_ == 0, record_, "end's length", "is not zero");
  const KeptMapCounts& held = head_.counts;
  demand(found_.blocks == held.blocks && found_.free_blocks == held.free_blocks &&
             found_.patches == held.patches,
         record_, "end", "comes before or after as many blocks and patches as the head says");
  demand(next_ == size_, next_, "end", "is followed by more bytes");
}

void MapReader::readBlock(MapTaker& taker) {
  demand(length_ == kBlockBytes + (head_.labels ? kLabelBytes : 0), record_, "block's length",
         "is not that of a block");
  LittleEndianReader from = payload();
  ReadBlock& block = *block_;
  block.index = readIndex(from, 0);
  block.sides = from.u8();
  const auto zeros = from.bytes(3);
  block.free_parts = 0;
  block.has_labels = head_.labels;
  demand(block.sides <= (BlockHeader::kInFront | BlockHeader::kBehind) &&
             std::ranges::all_of(zeros, [](std::uint8_t b) { return b == 0; }),
         at(kIndexBytes), "sides", "are none");
  block.drift = std::bit_cast<float>(from.u32());
  demand(std::isfinite(block.drift) && block.drift >= 0, at(kIndexBytes + 4), "drift", "is no length");
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
           "are not by falling count");
  }
  ++found_.blocks;
  taker.block(block);
}

void MapReader::readFree(MapTaker& taker) {
  const std::size_t each = whole_blocks_ ? kFreeBytesOfWholeBlocks : kFreeBytes;
  demand(length_ > 0 && length_ % each == 0, record_, "free blocks' length", "is not that of some");
  LittleEndianReader from = payload();
  for (std::size_t i = 0; i < length_; i += each) {
    const BlockIndex block = readIndex(from, i);
    std::uint64_t parts = kAllParts;
    if (whole_blocks_) {
      const std::uint16_t images = from.u16();
      demand(images > 0 && from.u16() == 0, at(i + kIndexBytes), "images that saw it free", "are none");
    } else {
      parts = from.u64();
      demand(parts != 0, at(i + kIndexBytes), "free parts", "are none");
    }
    ++found_.free_blocks;
    taker.freeBlock(block, parts);
  }
}

void MapReader::readPatch(MapTaker& taker) {
  demand(length_ >= kPatchBytes, record_, "patch's length", "is less than that of one");
  LittleEndianReader from = payload();
  patch_.block = readIndex(from, 0);
  const std::size_t vertices = from.u16();
  const std::size_t triangles = from.u16();
  demand(vertices <= kMostPatchVertices && triangles > 0 && triangles <= kMostPatchTriangles &&
             length_ == kPatchBytes + vertices * kVertexBytes + triangles * kTriangleBytes,
         at(kIndexBytes), "vertices and triangles", "are not as many as the record has bytes for");
  patch_.vertices.resize(vertices);
  patch_.triangles.resize(triangles);
  // A vertex lies between the block's first voxel and the next block's; one more for rounding.
  const auto voxel = static_cast<float>(head_.voxel_size);
  const Eigen::Array3f first =
      Eigen::Array3f(static_cast<float>(patch_.block.x), static_cast<float>(patch_.block.y),
                     static_cast<float>(patch_.block.z)) *
          kBlockSide -
      1;
  for (std::size_t i = 0; i < vertices; ++i) {
    SurfaceVertex& vertex = patch_.vertices[i];
    for (int axis = 0; axis < 3; ++axis) vertex.p_world[axis] = std::bit_cast<float>(from.u32());
    const Eigen::Array3f inside = vertex.p_world.array() / voxel - first;
    demand((inside >= 0).all() && (inside <= kBlockSide + 3).all(), at(kPatchBytes + i * kVertexBytes),
           "vertex", "does not lie in its block");
    for (std::int8_t& part : vertex.normal) part = static_cast<std::int8_t>(from.u8());
    vertex.grey = from.u8();
    vertex.label = from.u8();
    vertex.probability = from.u8();
    demand(vertex.label < kLabelValues, at(kPatchBytes + i * kVertexBytes), "label", "is none");
  }
  for (std::size_t i = 0; i < triangles; ++i) {
    for (std::uint16_t& corner : patch_.triangles[i]) {
      corner = from.u16();
      demand(corner < vertices, at(kPatchBytes + vertices * kVertexBytes + i * kTriangleBytes), "triangle",
             "has a corner that its patch has not");
    }
  }
  ++found_.patches;
  taker.patch(patch_);
}

/// Into an empty volume: what comes later lies farther, and is left out where room ends.
class VolumeLoader : public MapTaker {
 public:
  VolumeLoader(VoxelVolume& volume, const Eigen::Vector3d& p_map_vehicle, KeptMapReport& report)
      : volume_(volume), vehicle_(p_map_vehicle.cast<float>()), report_(report) {}

  void block(ReadBlock& block) override {
    const bool room = volume_.blockCount() < volume_.blockCapacity();
    const std::uint32_t slot = room ? volume_.obtain(block.index) : VoxelVolume::kNone;
    if (slot == VoxelVolume::kNone) {
      withoutRoom(block);
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
  void freeBlock(const BlockIndex& block, std::uint64_t parts) override {
    const bool room = volume_.freeCount() < volume_.freeCapacity();
    if (room && volume_.find(block) == VoxelVolume::kNone) volume_.addFree(block, parts, vehicle_);
    if (volume_.find(block) == VoxelVolume::kNone) ++report_.without_room.free_blocks;
  }

 protected:
  virtual void withoutRoom(ReadBlock& /*block*/) { ++report_.without_room.blocks; }
  [[nodiscard]] const Eigen::Vector3f& vehicle() const { return vehicle_; }
  [[nodiscard]] KeptMapReport& report() const { return report_; }

 private:
  VoxelVolume& volume_;
  Eigen::Vector3f vehicle_;
  KeptMapReport& report_;
};

/// The same, patches into an empty store, and blocks without room to the submaps.
class Loader final : public VolumeLoader {
 public:
  Loader(VoxelVolume& volume, SurfaceStore& surface, MapSubmaps* submaps,
         const Eigen::Vector3d& p_map_vehicle, KeptMapReport& report)
      : VolumeLoader(volume, p_map_vehicle, report), surface_(surface), submaps_(submaps) {}

  void patch(const SurfacePatch& patch) override {
    const SurfaceStoreCounters before = surface_.counters();
    surface_.put(patch, vehicle());
    const SurfaceStoreCounters& after = surface_.counters();
    report().without_room.patches += static_cast<std::uint32_t>(after.dropped - before.dropped);
  }

 protected:
  void withoutRoom(ReadBlock& block) override {
    if (submaps_ == nullptr) {
      VolumeLoader::withoutRoom(block);
    } else {
      submaps_->store(block);
    }
  }

 private:
  SurfaceStore& surface_;
  MapSubmaps* submaps_;  ///< null: nobody has room
};

std::ifstream opened(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  if (!in)
    throw InputError(path, 0, "", "cannot be opened",
                     "Give a file that --keep wrote, or a folder that --keep-map wrote with --map");
  return in;
}

/// Memory that holds all of it.
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

void loadKeptMap(const std::string& name, std::istream& in, VoxelVolume& volume, SurfaceStore& surface,
                 MapSubmaps* submaps, KeptMapReport& report) {
  MapReader reader(name, in);
  reader.demandSettings(volume.settings());
  volume.beginChange();
  Loader loader(volume, surface, submaps, reader.head().p_map_vehicle, report);
  reader.walk(loader);
}

KeptMapReport readKeptMap(const std::string& name, std::istream& in, MapStage& map) {
  KeptMapReport report = checkKeptMap(name, in, map.volume().settings());
  try {
    map.restore(report.epoch, report.p_map_vehicle,
                [&](VoxelVolume& volume, SurfaceStore& surface, MapSubmaps& submaps) {
                  loadKeptMap(name, in, volume, surface, &submaps, report);
                });
  } catch (const InputError&) {
    map.restore(0, Eigen::Vector3d::Zero(),
                [](VoxelVolume& /*volume*/, SurfaceStore& /*surface*/, MapSubmaps& /*submaps*/) {});
    throw;
  }
  return report;
}

KeptMapReport readKeptMapFile(const std::string& path, MapStage& map) {
  std::ifstream in = opened(path);
  return readKeptMap(path, in, map);
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
  VolumeLoader loader(volume, reader.head().p_map_vehicle, report);
  reader.walk(loader);
  if (report.without_room.blocks + report.without_room.free_blocks > 0) {
    throw InputError(path, 0, "", "blocks of the map find no place in the volume's index",
                     "Keep the map anew");
  }
  return volume;
}

}  // namespace swiftlet
