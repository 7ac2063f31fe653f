#include <algorithm>
#include <cmath>
#include <ostream>
#include <span>
#include <streambuf>
#include <vector>

#include "drivers/device/byte_fields.hpp"
#include "drivers/input/input_error.hpp"
#include "drivers/recorded/recording_checksum.hpp"
#include "firmware_host/files/whole_file.hpp"
#include "firmware_host/outputs/map_files/kept_map_format.hpp"

namespace swiftlet {
namespace {

using namespace kept;  // NOLINT(google-build-using-namespace)

struct Placed {
  Nearness nearness;
  std::uint32_t slot = 0;
  bool operator<(const Placed& other) const { return nearness < other.nearness; }
};

class MapWriter {
 public:
  MapWriter(const std::string& name, std::ostream& out, const MapParts& map)
      : name_(name), out_(out), map_(map), bytes_(kRecordBytes + kMostPayload) {}

  KeptMapCounts operator()() {
    place();
    writeHead();
    for (const Placed& block : blocks_) writeBlock(block.slot);
    writeFree();
    finish(Kind::kEnd, payload());
    out_.flush();
    if (!out_)
      throw InputError(name_, 0, "", "cannot be written",
                       "Check that the folder is writable and the disk is not full");
    return head_.counts;
  }

 private:
  void place();
  void writeHead();
  void writeBlock(std::uint32_t slot);
  void writeFree();
  LittleFieldWriter payload() { return LittleFieldWriter(std::span(bytes_).subspan(kRecordBytes)); }
  void finish(Kind kind, const LittleFieldWriter& payload);
  static void index(LittleFieldWriter& to, const BlockIndex& block) {
    to.i32(block.x);
    to.i32(block.y);
    to.i32(block.z);
  }

  const std::string& name_;
  std::ostream& out_;
  MapParts map_;
  Head head_;
  std::vector<Placed> blocks_, free_;
  std::vector<std::uint8_t> bytes_;
  std::uint32_t head_crc_ = 0;
};

void MapWriter::place() {
  const VolumeSettings& settings = map_.volume.settings();
  head_ = {settings.voxel_size, settings.truncation, settings.reference_sigma,
           settings.labels,     map_.epoch,          {},
           map_.p_map_vehicle,  map_.least_weight};
  const BlockIndex vehicle = vehicleBlock(head_);
  for (std::uint32_t slot = 0; slot < map_.volume.slots(); ++slot) {
    const BlockHeader& header = map_.volume.header(slot);
    if (header.state == BlockState::kVoxels) blocks_.push_back({nearness(header.index, vehicle), slot});
    if (header.state == BlockState::kFree) free_.push_back({nearness(header.index, vehicle), slot});
  }
  for (auto* list : {&blocks_, &free_}) std::sort(list->begin(), list->end());
  head_.counts = {static_cast<std::uint32_t>(blocks_.size()), static_cast<std::uint32_t>(free_.size())};
}

void MapWriter::writeHead() {
  LittleFieldWriter to(bytes_);
  to.copy(kMagic);
  to.u32(kVersion);
  to.u32(static_cast<std::uint32_t>(kHeadBytes));
  to.f64(head_.voxel_size);
  to.f64(head_.truncation);
  to.f64(head_.reference_sigma);
  to.u32(head_.labels ? kHasLabels : 0U);
  to.u32(head_.epoch);
  to.u32(head_.counts.blocks);
  to.u32(head_.counts.free_blocks);
  to.f32(static_cast<float>(head_.least_weight));
  to.u32(kBlockSide);
  for (int axis = 0; axis < 3; ++axis) to.f64(head_.p_map_vehicle[axis]);
  to.zeros(kHeadCrcAt - to.written().size());
  head_crc_ = crc32c(0, {bytes_.data(), kHeadCrcAt});
  to.u32(head_crc_);
  out_.write(reinterpret_cast<const char*>(bytes_.data()), static_cast<std::streamsize>(kHeadBytes));
}

void MapWriter::finish(Kind kind, const LittleFieldWriter& payload) {
  const std::size_t size = payload.written().size();
  LittleFieldWriter to(bytes_);
  to.u32(0);
  to.u16(static_cast<std::uint16_t>(kind));
  to.u16(0);
  to.u32(static_cast<std::uint32_t>(size));
  constexpr std::size_t kCrc = sizeof(std::uint32_t);
  const std::uint32_t crc = crc32c(head_crc_, {bytes_.data() + kCrc, kRecordBytes - kCrc + size});
  LittleFieldWriter(bytes_).u32(crc);
  out_.write(reinterpret_cast<const char*>(bytes_.data()), static_cast<std::streamsize>(kRecordBytes + size));
}

void MapWriter::writeBlock(std::uint32_t slot) {
  const BlockHeader& header = map_.volume.header(slot);
  const VoxelBlock& voxels = *map_.volume.voxels(slot);
  LittleFieldWriter to = payload();
  index(to, header.index);
  to.u8(header.sides);
  to.zeros(3);
  to.f32(header.drift);
  for (const std::int16_t distance : voxels.distance) to.u16(static_cast<std::uint16_t>(distance));
  for (const std::uint16_t weight : voxels.weight) to.u16(weight);
  to.copy(voxels.grey);
  if (const LabelBlock* labels = map_.volume.labels(slot); labels != nullptr) {
    for (const LabelCounts& counts : labels->counts) {
      for (const std::uint16_t word : counts.words()) to.u16(word);
    }
  }
  finish(Kind::kBlock, to);
}

void MapWriter::writeFree() {
  for (std::size_t first = 0; first < free_.size(); first += kMostFree) {
    LittleFieldWriter to = payload();
    for (std::size_t i = first; i < std::min(first + kMostFree, free_.size()); ++i) {
      const BlockHeader& header = map_.volume.header(free_[i].slot);
      index(to, header.index);
      to.u64(header.free_parts);
    }
    finish(Kind::kFree, to);
  }
}

class IntoWholeFile : public std::streambuf {
 public:
  explicit IntoWholeFile(WholeFile& file) : file_(file) {}

 protected:
  std::streamsize xsputn(const char* bytes, std::streamsize count) override {
    file_.write({bytes, static_cast<std::size_t>(count)});
    return count;
  }

 private:
  WholeFile& file_;
};

}  // namespace

KeptMapCounts writeKeptMap(const std::string& name, std::ostream& out, const MapParts& map) {
  return MapWriter(name, out, map)();
}

KeptMapCounts writeKeptMapFile(const std::string& path, MapStage& map,
                               const std::function<bool(std::uint32_t epoch)>& wanted) {
  const VoxelVolume whole = map.wholeVolume(wanted);
  return writeKeptMapFile(path, {whole, map.surfaceSettings().least_weight, map.epoch(), map.vehicle()});
}

KeptMapCounts writeKeptMapFile(const std::string& path, const MapParts& map) {
  WholeFile file(path);
  IntoWholeFile buffer(file);
  std::ostream out(&buffer);
  out.exceptions(std::ios::badbit);  // rethrows the file's own exceptions
  const KeptMapCounts counts = writeKeptMap(path, out, map);
  file.commit();
  return counts;
}

}  // namespace swiftlet
