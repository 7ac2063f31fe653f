#include "drivers/recorded/recording_index.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <limits>

#include "drivers/device/byte_fields.hpp"
#include "drivers/input/input_error.hpp"
#include "drivers/recorded/recording_checksum.hpp"

namespace swiftlet {
namespace {

constexpr std::size_t kLargestSmallPayload = kMapStepHeadBytes;
constexpr const char* kReplayBefore = "Remove this and the later segments to replay the part before it";

[[noreturn]] void refuse(const RecordingFile& file, std::uint64_t offset, const std::string& what,
                         const std::string& remedy) {
  throw InputError(file.name(), 0, fmt::format("byte {}", offset), what, remedy);
}

class Indexer {
 public:
  explicit Indexer(const RecordingFiles& files) : files_(files) {}

  RecordingIndex run() {
    if (files_.segments.empty()) {
      throw InputError(files_.folder, 0, "", "contains no segment of a recording",
                       "Give a folder with recording_*.swr");
    }
    for (segment_ = 0; segment_ < files_.segments.size() && index_.cut.reason == nullptr; ++segment_) {
      RecordingWindow window(*files_.segments[segment_]);
      if (takeSegmentHeader(window)) takeRecords(window);
    }
    mergeTurns();
    return std::move(index_);
  }

 private:
  bool takeSegmentHeader(RecordingWindow& window);
  bool belongs(const RecordingFile& file, const SegmentHeader& header);
  void takeRecords(RecordingWindow& window);
  const char* faultAt(RecordingWindow& window, std::uint64_t offset, RecordHeader& header) const;
  bool takeRecord(RecordingWindow& window, std::uint64_t& offset);
  void take(const RecordHeader& header, RecordingWindow& window, std::uint64_t offset);
  void takeRun(const RecordHeader& header, RecordingWindow& window, std::uint64_t offset);
  void takeImu(LittleFieldReader& from);
  void takeImage(const RecordHeader& header, LittleFieldReader& from, const RecordingFile& file,
                 std::uint64_t offset);
  void takeTrackStep(LittleFieldReader& from);
  void takeSmoothStep(LittleFieldReader& from);
  void takeMeshStep(LittleFieldReader& from);
  void takeLoopStep(LittleFieldReader& from);
  void takeMapStep(const RecordHeader& header, LittleFieldReader& from, const RecordingFile& file,
                   std::uint64_t offset);
  void takeLoss(LittleFieldReader& from, const RecordingFile& file, std::uint64_t offset);
  void cutAt(std::uint64_t offset, const char* reason);
  [[nodiscard]] std::uint64_t soundRecords(RecordingWindow& window, std::size_t segment,
                                           std::uint64_t offset) const;
  void mergeTurns();

  const RecordingFiles& files_;
  RecordingIndex index_;
  RunId run_{};
  std::uint32_t segment_ = 0;
  std::uint64_t sequence_ = 0;                             ///< expected for the next record
  std::array<std::uint64_t, kRecordKinds> last_number_{};  ///< by kind, lost records included
};

bool allZero(std::span<const std::uint8_t> bytes) {
  return std::all_of(bytes.begin(), bytes.end(), [](std::uint8_t byte) { return byte == 0; });
}

/// Computes the CRC of a record's payload and padding; false if the file ends before.
bool payloadChecksum(RecordingWindow& window, std::uint64_t offset, std::uint64_t size, std::uint32_t& crc) {
  while (size > 0) {
    std::span<const std::uint8_t> part = window.some(offset);
    if (part.empty()) return false;
    part = part.first(static_cast<std::size_t>(std::min<std::uint64_t>(part.size(), size)));
    crc = crc32c(crc, part);
    offset += part.size();
    size -= part.size();
  }
  return true;
}

bool Indexer::takeSegmentHeader(RecordingWindow& window) {
  const RecordingFile& file = window.file();
  const std::span<const std::uint8_t> bytes = window.exactly(0, kSegmentHeaderBytes);
  const bool first = segment_ == 0;
  if (bytes.size() < kSegmentHeaderBytes || allZero(bytes)) {
    if (first) refuse(file, 0, "the file's header is missing: nothing was recorded", "Record again");
    cutAt(0, "the segment's header is incomplete");
    return false;
  }
  SegmentHeader header;
  switch (decode(bytes.first<kSegmentHeaderBytes>(), header)) {
    case SegmentHeaderState::kGood:
      break;
    case SegmentHeaderState::kForeign:
      refuse(file, 0, "is not a segment of a flight recording: it starts differently",
             first ? "Give a folder with recording_*.swr written by this program" : kReplayBefore);
    case SegmentHeaderState::kOtherVersion:
      refuse(
          file, kSegmentMagic.size(),
          fmt::format("format version {}, this program reads version {}", header.version, kRecordingVersion),
          "Replay it with the program that recorded it");
    case SegmentHeaderState::kDamaged:
      if (first) {
        refuse(file, 0, "the file's header is damaged (checksum)",
               "Without it no record can be checked; restore a copy");
      }
      cutAt(0, "the segment's header is damaged (checksum)");
      return false;
  }
  return belongs(file, header);
}

bool Indexer::belongs(const RecordingFile& file, const SegmentHeader& header) {
  if (segment_ == 0) {
    run_ = header.run;
    index_.run_checksum = runChecksum(run_);
  }
  if (header.run != run_) {
    refuse(file, kSegmentMagic.size() + 8, "belongs to another recording than the first segment",
           kReplayBefore);
  }
  if (header.segment != segment_) {
    refuse(file, kSegmentMagic.size() + 4,
           fmt::format("this is segment {} under another name", header.segment),
           "Restore the original names of the segments");
  }
  if (header.first_sequence == sequence_ && !index_.ended) return true;
  cutAt(0, index_.ended ? "data follows the end mark" : "records before this segment are missing");
  return false;
}

void Indexer::takeRecords(RecordingWindow& window) {
  std::uint64_t offset = kSegmentHeaderBytes;
  while (offset < window.file().size()) {
    if (!takeRecord(window, offset)) return;
  }
  if (sequence_ == 0) refuse(window.file(), offset, "the run's header is missing", "Record again");
}

/// Null if a valid record begins at `offset`, else the reason why not.
const char* Indexer::faultAt(RecordingWindow& window, std::uint64_t offset, RecordHeader& header) const {
  if (index_.ended) return "data follows the end mark";
  const std::span<const std::uint8_t> bytes = window.exactly(offset, kRecordHeaderBytes);
  if (allZero(bytes)) return "only zeros are written here";
  const bool header_there = bytes.size() == kRecordHeaderBytes;
  if (header_there) {
    if (!decode(bytes.first<kRecordHeaderBytes>(), index_.run_checksum, header)) {
      return "a record's header is damaged (checksum)";
    }
    if (header.sequence != sequence_) return "records are missing before this one (sequence number)";
  }
  const std::uint64_t payload = offset + kRecordHeaderBytes;
  if (!header_there || payload + paddedSize(header.length) > window.file().size()) {
    return "a record is incomplete";
  }
  std::uint32_t crc = index_.run_checksum;
  const bool there = payloadChecksum(window, payload, paddedSize(header.length), crc);
  return there && crc == header.payload_crc ? nullptr : "a record is damaged (checksum)";
}

/// Reads one record and advances; false if the recording was cut here instead.
bool Indexer::takeRecord(RecordingWindow& window, std::uint64_t& offset) {
  RecordHeader header;
  if (const char* fault = faultAt(window, offset, header)) {
    if (sequence_ == 0) {
      refuse(window.file(), offset, std::string("the run's header is incomplete: ") + fault,
             "Without it nothing can be replayed; restore a copy");
    }
    cutAt(offset, fault);
    return false;
  }
  take(header, window, offset);
  ++sequence_;
  ++index_.records;
  offset += kRecordHeaderBytes + paddedSize(header.length);
  return true;
}

/// Payload bytes of a kind; the minimum if pixels may follow; 0 (unknown) for kRun.
std::size_t payloadBytes(RecordKind kind) {
  switch (kind) {
    case RecordKind::kImu:
      return kImuPayloadBytes;
    case RecordKind::kImage0:
    case RecordKind::kImage1:
      return kImageHeadBytes;
    case RecordKind::kPropagateStep:
      return kPropagateStepBytes;
    case RecordKind::kTrackStep:
      return kTrackStepBytes;
    case RecordKind::kSmoothStep:
      return kSmoothStepBytes;
    case RecordKind::kMeshStep:
      return kMeshStepBytes;
    case RecordKind::kLoopStep:
      return kLoopStepBytes;
    case RecordKind::kMapStep:
      return kMapStepHeadBytes;
    case RecordKind::kLoss:
      return kLossBytes;
    case RecordKind::kEnd:
      return kEndBytes;
    case RecordKind::kRun:
      break;
  }
  return 0;
}

void Indexer::take(const RecordHeader& header, RecordingWindow& window, std::uint64_t offset) {
  const RecordingFile& file = window.file();
  const RecordKind kind = header.kind;
  if (static_cast<std::size_t>(kind) >= kRecordKinds || (kind == RecordKind::kRun) != (sequence_ == 0)) {
    refuse(file, offset, fmt::format("record kind {} is unknown or not allowed here", static_cast<int>(kind)),
           "Replay it with the program that recorded it");
  }
  if (kind == RecordKind::kRun) return takeRun(header, window, offset);
  const bool pixels =
      kind == RecordKind::kImage0 || kind == RecordKind::kImage1 || kind == RecordKind::kMapStep;
  const bool older = kind == RecordKind::kSmoothStep && header.length == kSmoothStepBytesBeforePlanes;
  const std::size_t length = older ? kSmoothStepBytesBeforePlanes : payloadBytes(kind);
  if (pixels ? header.length < length : header.length != length) {
    refuse(file, offset, fmt::format("a record of {} has {} bytes", pluralName(kind), header.length),
           "Replay it with the program that recorded it");
  }
  // Copied, because the window moves.
  std::array<std::uint8_t, kLargestSmallPayload> payload{};
  const std::span<const std::uint8_t> bytes = window.exactly(offset + kRecordHeaderBytes, length);
  std::copy(bytes.begin(), bytes.end(), payload.begin());
  LittleFieldReader from(payload);
  std::uint64_t& number = last_number_[static_cast<std::size_t>(kind)];
  if (number == std::numeric_limits<std::uint64_t>::max()) {
    refuse(file, offset, "more records lost than can be counted", kReplayBefore);
  }
  ++number;
  switch (kind) {
    case RecordKind::kImu:
      return takeImu(from);
    case RecordKind::kImage0:
    case RecordKind::kImage1:
      return takeImage(header, from, file, offset);
    case RecordKind::kPropagateStep: {
      PropagateStep& step = index_.steps.propagate.emplace_back();
      step.samples = from.u64();
      step.fix = from.u64();
      return;
    }
    case RecordKind::kTrackStep:
      return takeTrackStep(from);
    case RecordKind::kSmoothStep:
      return takeSmoothStep(from);
    case RecordKind::kMeshStep:
      return takeMeshStep(from);
    case RecordKind::kLoopStep:
      return takeLoopStep(from);
    case RecordKind::kMapStep:
      return takeMapStep(header, from, file, offset);
    case RecordKind::kLoss:
      return takeLoss(from, file, offset);
    default:
      index_.ended = true;
  }
}

void Indexer::takeRun(const RecordHeader& header, RecordingWindow& window, std::uint64_t offset) {
  std::vector<std::uint8_t> payload;
  std::uint64_t at = offset + kRecordHeaderBytes;
  while (payload.size() < header.length) {
    std::span<const std::uint8_t> part = window.some(at);
    if (part.empty()) refuse(window.file(), at, "the file was truncated while it was read", "Read a copy");
    part = part.first(std::min(part.size(), header.length - payload.size()));
    payload.insert(payload.end(), part.begin(), part.end());
    at += part.size();
  }
  if (const char* field = decodeRecordingHeader(payload, index_.header)) {
    refuse(window.file(), offset, fmt::format("the run's header is intact but its {} is invalid", field),
           "Replay it with the program that recorded it");
  }
}

void Indexer::takeImu(LittleFieldReader& from) {
  RecordedImu& entry = index_.imu.emplace_back();
  entry.sample.stamp.ns = from.i64();
  entry.arrival.ns = from.i64();
  for (int i = 0; i < 3; ++i) entry.sample.gyro[i] = from.f64();
  for (int i = 0; i < 3; ++i) entry.sample.accel[i] = from.f64();
  index_.turns.push_back(static_cast<std::uint8_t>(RecordKind::kImu));
}

void Indexer::takeImage(const RecordHeader& header, LittleFieldReader& from, const RecordingFile& file,
                        std::uint64_t offset) {
  const std::size_t camera = header.kind == RecordKind::kImage0 ? 0 : 1;
  RecordedImage& entry = index_.images[camera].emplace_back();
  entry.stamp.ns = from.i64();
  entry.arrival.ns = from.i64();
  (void)from.u64();
  const std::int64_t width = from.i32();
  const std::int64_t height = from.i32();
  const std::uint32_t clock = from.u32();
  entry.number = last_number_[static_cast<std::size_t>(header.kind)];
  entry.offset = offset;
  entry.segment = segment_;
  entry.length = header.length;
  const std::int64_t pixels = static_cast<std::int64_t>(header.length) - std::int64_t{kImageHeadBytes};
  const bool fits = pixels == 0 || (width > 0 && height > 0 && width * height == pixels);
  if (!fits || clock > 1 || header.length > kMaxPayloadBytes) {
    refuse(file, offset,
           fmt::format("an image of {}x{} with {} bytes of pixels on clock {}", width, height, pixels, clock),
           "Replay it with the program that recorded it");
  }
  index_.turns.push_back(static_cast<std::uint8_t>(header.kind));
}

void Indexer::takeTrackStep(LittleFieldReader& from) {
  TrackStep& step = index_.steps.track.emplace_back();
  step.frame = from.u64();
  step.stamp.ns = from.i64();
  for (std::uint64_t& image : step.image) image = from.u64();
  step.samples = from.u64();
  step.window = from.u64();
  step.effort.iterations = from.i32();
  step.effort.features = from.i32();
  step.effort.keyframes = from.i32();
}

void Indexer::takeSmoothStep(LittleFieldReader& from) {
  SmoothStep& step = index_.steps.smooth.emplace_back();
  step.frame = from.u64();
  step.samples = from.u64();
  step.effort.iterations = from.i32();
  step.effort.features = from.i32();
  step.effort.keyframes = from.i32();
  (void)from.u32();
  step.planes = from.u64();  // zero in an older, shorter record
}

void Indexer::takeMeshStep(LittleFieldReader& from) {
  MeshStep& step = index_.steps.mesh.emplace_back();
  step.frame = from.u64();
  step.window = from.u64();
  step.image = from.u64();
}

void Indexer::takeLoopStep(LittleFieldReader& from) {
  LoopStep& step = index_.steps.loop.emplace_back();
  step.frame = from.u64();
  step.window = from.u64();
  for (std::uint64_t& image : step.image) image = from.u64();
}

void Indexer::takeMapStep(const RecordHeader& header, LittleFieldReader& from, const RecordingFile& file,
                          std::uint64_t offset) {
  MapStep& step = index_.steps.map.emplace_back();
  step.frame = from.u64();
  step.correction = from.u64();
  step.spare_turns = from.u64();
  for (std::uint64_t& image : step.image) image = from.u64();
  const std::uint32_t end = from.u32();
  step.end = end == 1;
  (void)from.u32();
  (void)from.i64();
  (void)from.i64();
  std::array<std::int64_t, 2> width{};
  std::array<std::int64_t, 2> height{};
  for (std::size_t i = 0; i < width.size(); ++i) {
    width[i] = from.i32();
    height[i] = from.i32();
  }
  const auto& sensor = index_.header.depth_sensor;
  const bool no_depth = width[0] == 0 && height[0] == 0;
  const bool depth_fits =
      no_depth || (sensor && width[0] == sensor->camera.width && height[0] == sensor->camera.height);
  const bool no_labels = width[1] == 0 && height[1] == 0;
  const bool labels_fit = no_labels || (width[1] > 0 && height[1] > 0);
  const std::int64_t pixels = static_cast<std::int64_t>(header.length) - std::int64_t{kMapStepHeadBytes};
  const bool fits = depth_fits && labels_fit && header.length <= kMaxPayloadBytes &&
                    std::int64_t{sizeof(float)} * width[0] * height[0] + width[1] * height[1] == pixels;
  if (!fits || end > 1) {
    refuse(file, offset,
           fmt::format("a mapping step with depth of {}x{} and labels of {}x{} in {} bytes, end {}", width[0],
                       height[0], width[1], height[1], pixels, end),
           "Replay it with the program that recorded it");
  }
  index_.scenes.push_back({offset, segment_, header.length});
}

void Indexer::takeLoss(LittleFieldReader& from, const RecordingFile& file, std::uint64_t offset) {
  const std::uint32_t kind = from.u32();
  (void)from.u32();
  const std::uint64_t count = from.u64();
  const bool known = kind < kRecordKinds && canBeLost(static_cast<RecordKind>(kind));
  if (!known || count > std::numeric_limits<std::uint64_t>::max() - last_number_[kind]) {
    refuse(file, offset, fmt::format("{} lost records of kind {}", count, kind),
           "Replay it with the program that recorded it");
  }
  const Stamp newest = index_.imu.empty() ? Stamp{} : index_.imu.back().sample.stamp;
  index_.losses.push_back(
      {static_cast<RecordKind>(kind), last_number_[kind], count, newest, segment_, offset});
  last_number_[kind] += count;
}

void Indexer::cutAt(std::uint64_t offset, const char* reason) {
  RecordingCut& cut = index_.cut;
  cut.reason = reason;
  cut.segment = segment_;
  cut.offset = offset;
  for (std::size_t i = segment_; i < files_.segments.size(); ++i) {
    RecordingWindow window(*files_.segments[i]);
    const std::uint64_t begin = i == segment_ ? offset : 0;
    cut.bytes += window.file().size() - begin;
    cut.sound_records += soundRecords(window, i, begin);
  }
}

/// Counts the valid records of a segment from `offset` on, except the damaged one. Only headers are checked,
/// so that the search stays one pass for any content.
std::uint64_t Indexer::soundRecords(RecordingWindow& window, std::size_t segment,
                                    std::uint64_t offset) const {
  std::uint64_t found = 0;
  while (true) {
    const std::span<const std::uint8_t> bytes = window.exactly(offset, kRecordHeaderBytes);
    if (bytes.size() < kRecordHeaderBytes) return found;
    RecordHeader header;
    std::uint64_t step = kRecordAlignment;
    const bool damaged_one = segment == index_.cut.segment && offset == index_.cut.offset;
    if (decode(bytes.first<kRecordHeaderBytes>(), index_.run_checksum, header) &&
        (damaged_one ? header.sequence > sequence_ : header.sequence >= sequence_)) {
      step = kRecordHeaderBytes + paddedSize(header.length);
      if (offset + step <= window.file().size()) ++found;
    }
    offset += step;
  }
}

/// Merge by arrival: the stream whose next message arrived first is next, and each stream keeps its own
/// order. A message whose arrival is earlier than its predecessor's therefore follows it immediately.
void Indexer::mergeTurns() {
  if (index_.header.order == RecordOrder::kAsWritten) return;
  constexpr std::size_t kStreams = 1 + kMaxCameras;
  const std::array<std::size_t, kStreams> sizes{index_.imu.size(), index_.images[0].size(),
                                                index_.images[1].size()};
  const auto arrival = [this](std::size_t stream, std::size_t i) {
    return stream == 0 ? index_.imu[i].arrival : index_.images[stream - 1][i].arrival;
  };
  constexpr std::array<RecordKind, kStreams> kKinds{RecordKind::kImu, RecordKind::kImage0,
                                                    RecordKind::kImage1};
  std::array<std::size_t, kStreams> next{};
  for (std::uint8_t& turn : index_.turns) {
    std::size_t best = kStreams;
    for (std::size_t s = 0; s < kStreams; ++s) {
      if (next[s] == sizes[s]) continue;
      if (best == kStreams || arrival(s, next[s]) < arrival(best, next[best])) best = s;
    }
    ++next[best];
    turn = static_cast<std::uint8_t>(kKinds[best]);
  }
}

}  // namespace

RecordingIndex indexRecording(const RecordingFiles& files) { return Indexer(files).run(); }

}  // namespace swiftlet
