#include "drivers/recorded/recording_format.hpp"

#include <algorithm>
#include <cstdio>

#include "drivers/device/byte_fields.hpp"
#include "drivers/recorded/recording_checksum.hpp"

namespace swiftlet {
namespace {

constexpr std::size_t kSegmentChecksumAt = kSegmentHeaderBytes - sizeof(std::uint32_t);
constexpr std::size_t kSegmentDigits = 6;
constexpr char kSegmentPrefix[] = "recording_";
constexpr char kSegmentSuffix[] = ".swr";

}  // namespace

const char* pluralName(RecordKind kind) {
  switch (kind) {
    case RecordKind::kImu:
      return "IMU samples";
    case RecordKind::kImage0:
      return "images of camera 0";
    case RecordKind::kImage1:
      return "images of camera 1";
    case RecordKind::kPropagateStep:
      return "propagation steps";
    case RecordKind::kTrackStep:
      return "tracking steps";
    case RecordKind::kSmoothStep:
      return "smoothing steps";
    case RecordKind::kMeshStep:
      return "mesh steps";
    case RecordKind::kLoopStep:
      return "loop closure's steps";
    case RecordKind::kMapStep:
      return "mapping steps";
    default:
      return "marks";
  }
}

SegmentName segmentName(std::uint32_t segment) {
  SegmentName name{};
  std::snprintf(name.data(), name.size(), "%s%06u%s", kSegmentPrefix, segment % kMaxSegments, kSegmentSuffix);
  return name;
}

bool parseSegmentName(const std::string& name, std::uint32_t& segment) {
  const std::string prefix = kSegmentPrefix;
  const std::string suffix = kSegmentSuffix;
  if (name.size() != prefix.size() + kSegmentDigits + suffix.size()) return false;
  if (!name.starts_with(prefix) || !name.ends_with(suffix)) return false;
  segment = 0;
  for (std::size_t i = 0; i < kSegmentDigits; ++i) {
    const char digit = name[prefix.size() + i];
    if (digit < '0' || digit > '9') return false;
    segment = segment * 10 + static_cast<std::uint32_t>(digit - '0');
  }
  return true;
}

std::uint32_t runChecksum(const RunId& run) { return crc32c(0, run); }

void encode(const SegmentHeader& header, std::span<std::uint8_t, kSegmentHeaderBytes> out) {
  LittleFieldWriter to(out);
  to.copy(kSegmentMagic);
  to.u32(header.version);
  to.u32(header.segment);
  to.copy(header.run);
  to.u64(header.first_sequence);
  to.zeros(kSegmentChecksumAt - to.written().size());
  to.u32(crc32c(0, out.first(kSegmentChecksumAt)));
}

void encode(const RecordHeader& header, std::uint32_t run_checksum,
            std::span<std::uint8_t, kRecordHeaderBytes> out) {
  LittleFieldWriter to(out);
  to.u32(0);
  to.u32(header.payload_crc);
  to.u64(header.sequence);
  to.u32(header.length);
  to.u16(static_cast<std::uint16_t>(header.kind));
  to.u16(kRecordMark);
  LittleFieldWriter(out).u32(crc32c(run_checksum, out.subspan(sizeof(std::uint32_t))));
}

SegmentHeaderState decode(std::span<const std::uint8_t, kSegmentHeaderBytes> in, SegmentHeader& header) {
  LittleFieldReader from(in);
  const std::span<const std::uint8_t> magic = from.bytes(kSegmentMagic.size());
  if (!std::equal(magic.begin(), magic.end(), kSegmentMagic.begin())) return SegmentHeaderState::kForeign;
  header.version = from.u32();
  header.segment = from.u32();
  const std::span<const std::uint8_t> run = from.bytes(header.run.size());
  std::copy(run.begin(), run.end(), header.run.begin());
  header.first_sequence = from.u64();
  const std::uint32_t stated = LittleFieldReader(in.subspan(kSegmentChecksumAt)).u32();
  if (stated != crc32c(0, in.first(kSegmentChecksumAt))) return SegmentHeaderState::kDamaged;
  return header.version == kRecordingVersion ? SegmentHeaderState::kGood : SegmentHeaderState::kOtherVersion;
}

bool decode(std::span<const std::uint8_t, kRecordHeaderBytes> in, std::uint32_t run_checksum,
            RecordHeader& header) {
  LittleFieldReader from(in);
  const std::uint32_t stated = from.u32();
  header.payload_crc = from.u32();
  header.sequence = from.u64();
  header.length = from.u32();
  header.kind = static_cast<RecordKind>(from.u16());
  // Check the mark first: it is cheap, and a search for the next record tries many positions.
  if (from.u16() != kRecordMark) return false;
  return stated == crc32c(run_checksum, in.subspan(sizeof(std::uint32_t)));
}

}  // namespace swiftlet
