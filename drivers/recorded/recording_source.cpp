#include "drivers/recorded/recording_source.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "drivers/device/byte_fields.hpp"
#include "drivers/recorded/recording_checksum.hpp"

namespace swiftlet {
namespace {

// Slots start at separate cache lines.
constexpr std::size_t kSlotAlignment = 64;

/// Bytes of a record after its head: pixels and padding.
std::size_t bodyBytes(const RecordedImage& entry) { return paddedSize(entry.length) - kImageHeadBytes; }
std::size_t bodyBytes(const RecordedScene& entry) { return paddedSize(entry.length) - kMapStepHeadBytes; }

}  // namespace

RecordingSource::RecordingSource(RecordingFiles files, const LogOptions& options, const std::string& folder)
    : files_(std::move(files)), without_images_(options.without_images), wants_image_(options.wants_image) {
  if (!folder.empty()) lock_.emplace(folder);
  index_ = indexRecording(files_);
  chooseCalibration(options);
  countImages();
  reservePools();
  warn();
}

void RecordingSource::chooseCalibration(const LogOptions& options) {
  const Rig& recorded = index_.header.rig;
  if (options.calibration.empty()) {
    calibration_.form = index_.header.calibration_form;
    calibration_.rig = recorded;
    calibration_.noise = index_.header.noise;
  } else {
    calibration_ = readCalibration(options.calibration, options.imu_calibration, options.calibration_options);
    for (const std::string& line : calibration_.warnings) warnings_.add(line);
    calibration_.forgetImuCorrection();
    calibration_.rig.camera_count = std::min(calibration_.rig.camera_count, recorded.camera_count);
    cameras_ = calibration_.rig.camera_count;
    for (std::size_t i = 0; i < calibration_.rig.camera_count; ++i) {
      const CameraModel& given = calibration_.rig.camera[i];
      const CameraModel& used = recorded.camera[i];
      if (given.width() == used.width() && given.height() == used.height()) continue;
      throw InputError(options.calibration, 0, "",
                       fmt::format("cam{} has {}x{} pixels, but the recording was made with {}x{}", i,
                                   given.width(), given.height(), used.width(), used.height()),
                       "Give the calibration of this image size");
    }
  }
  if (options.mono) {
    calibration_.rig.camera_count = std::min<std::size_t>(calibration_.rig.camera_count, 1);
    cameras_ = 1;
  }
}

bool RecordingSource::delivers(RecordKind kind) const {
  if (kind == RecordKind::kImu) return true;
  const std::size_t camera = kind == RecordKind::kImage0 ? 0 : 1;
  return !without_images_ && camera < cameras_;
}

void RecordingSource::countImages() {
  std::vector<std::int64_t> stamps;
  for (std::size_t camera = 0; camera < kMaxCameras; ++camera) {
    if (!delivers(imageKind(camera))) continue;
    for (const RecordedImage& entry : index_.images[camera]) stamps.push_back(entry.stamp.ns);
  }
  image_count_ = stamps.size();
  std::sort(stamps.begin(), stamps.end());
  frame_count_ = static_cast<std::size_t>(std::unique(stamps.begin(), stamps.end()) - stamps.begin());
}

void RecordingSource::reservePools() {
  for (std::size_t camera = 0; camera < kMaxCameras; ++camera) {
    std::size_t largest = 0;
    for (const RecordedImage& entry : index_.images[camera]) largest = std::max(largest, bodyBytes(entry));
    Pool& pool = pools_[camera];
    pool.slot_bytes = (largest + kSlotAlignment - 1) / kSlotAlignment * kSlotAlignment;
    pool.memory.resize(kImageSlots * pool.slot_bytes);
  }
  std::size_t largest = 0;
  for (const RecordedScene& entry : index_.scenes) largest = std::max(largest, bodyBytes(entry));
  scene_.resize(largest / sizeof(float));  // a multiple of kRecordAlignment
}

void RecordingSource::warn() {
  const RecordingCut& cut = index_.cut;
  const std::string& last_file = files_.segments.back()->name();
  if (cut.reason != nullptr) {
    std::string line = fmt::format("{}: byte {}: {}; the recording ends here, {} bytes are skipped",
                                   files_.segments[cut.segment]->name(), cut.offset, cut.reason, cut.bytes);
    if (cut.sound_records > 0) {
      line +=
          fmt::format(", among them {} intact records that cannot be used after the gap", cut.sound_records);
    }
    warnings_.add(line);
  } else if (!index_.ended) {
    warnings_.add(
        fmt::format("{}: byte {}: no end mark: the recording was interrupted; it is complete up to here",
                    last_file, files_.segments.back()->size()));
  }
  std::array<std::uint64_t, kRecordKinds> events{};
  std::array<std::uint64_t, kRecordKinds> lost{};
  for (const RecordingLoss& loss : index_.losses) {
    const auto kind = static_cast<std::size_t>(loss.kind);
    lost[kind] += loss.count;
    warnings_.addCounted(++events[kind],
                         fmt::format("{}: {} {} were lost while recording, after number {}", files_.folder,
                                     loss.count, pluralName(loss.kind), loss.after));
  }
  for (std::size_t kind = 0; kind < kRecordKinds; ++kind) {
    if (events[kind] <= LogWarnings::kPerKind) continue;
    warnings_.add(fmt::format("{}: {} {} in total were lost while recording", files_.folder, lost[kind],
                              pluralName(static_cast<RecordKind>(kind))));
  }
}

bool RecordingSource::complete() const {
  return index_.ended && index_.cut.reason == nullptr && index_.losses.empty();
}

std::optional<InputError> RecordingSource::firstLoss() const {
  if (index_.losses.empty()) return {};
  const RecordingLoss& loss = index_.losses.front();
  std::string what = fmt::format("{} {} were lost while recording, after number {}", loss.count,
                                 pluralName(loss.kind), loss.after);
  if (loss.newest_sample.ns != 0) what += fmt::format(", at stamp {}", loss.newest_sample.ns);
  if (index_.losses.size() > 1) what += fmt::format(" (the first of {} losses)", index_.losses.size());
  return InputError(files_.segments[loss.segment]->name(), 0, fmt::format("byte {}", loss.offset),
                    what + ": the run cannot be reproduced", "Omit --reproduce to replay what was recorded");
}

bool RecordingSource::next(SensorMessage& message) {
  while (turn_ < index_.turns.size()) {
    const auto kind = static_cast<RecordKind>(index_.turns[turn_++]);
    if (kind == RecordKind::kImu) {
      message = index_.imu[next_imu_++].sample;
      ++counters_.imu_samples;
      return true;
    }
    const std::size_t camera = kind == RecordKind::kImage0 ? 0 : 1;
    const RecordedImage& entry = index_.images[camera][next_image_[camera]++];
    if (!delivers(kind)) continue;
    if (wants_image_ && !wants_image_(entry.stamp, static_cast<std::uint32_t>(camera))) continue;
    CameraFrame frame;
    read(camera, entry, frame);
    ++counters_.images[camera];
    message = frame;
    return true;
  }
  return false;
}

void RecordingSource::seek(Stamp stamp) {
  turn_ = 0;
  next_imu_ = 0;
  next_image_ = {};
  for (; turn_ < index_.turns.size(); ++turn_) {
    const auto kind = static_cast<RecordKind>(index_.turns[turn_]);
    if (kind == RecordKind::kImu) {
      if (index_.imu[next_imu_].sample.stamp >= stamp) return;
      ++next_imu_;
      continue;
    }
    const std::size_t camera = kind == RecordKind::kImage0 ? 0 : 1;
    if (index_.images[camera][next_image_[camera]].stamp >= stamp) return;
    ++next_image_[camera];
  }
}

std::uint64_t RecordingSource::imuNumber(std::size_t i) const {
  std::uint64_t number = i + 1;
  for (const RecordingLoss& loss : index_.losses) {
    if (loss.kind == RecordKind::kImu && loss.after < number) number += loss.count;
  }
  return number;
}

std::uint64_t RecordingSource::lastImage(std::size_t camera) const {
  if (camera >= kMaxCameras || index_.images[camera].empty()) return 0;
  return index_.images[camera].back().number;
}

bool RecordingSource::image(std::size_t camera, std::uint64_t number, CameraFrame& frame) {
  if (camera >= kMaxCameras) return false;
  const std::vector<RecordedImage>& images = index_.images[camera];
  const auto found = std::lower_bound(
      images.begin(), images.end(), number,
      [](const RecordedImage& entry, std::uint64_t wanted) { return entry.number < wanted; });
  if (found == images.end() || found->number != number) return false;
  read(camera, *found, frame);
  return true;
}

void RecordingSource::read(std::size_t camera, const RecordedImage& entry, CameraFrame& frame) {
  Pool& pool = pools_[camera];
  std::array<std::uint8_t, kRecordHeaderBytes + kImageHeadBytes> head{};
  const std::span<std::uint8_t> body(pool.memory.data() + pool.slot * pool.slot_bytes, bodyBytes(entry));
  readSound(entry, head, body);
  LittleFieldReader from{std::span(head).subspan<kRecordHeaderBytes>()};
  frame.stamp.ns = from.i64();
  frame.arrival.ns = from.i64();
  if (frame.stamp != entry.stamp || frame.arrival != entry.arrival) refuseChanged(entry);
  frame.sequence = from.u64();
  frame.image.width = from.i32();
  frame.image.height = from.i32();
  frame.clock = static_cast<Clock>(from.u32());
  frame.camera = static_cast<std::uint32_t>(camera);
  frame.image.stride = frame.image.width;
  frame.image.data = nullptr;
  if (entry.length == kImageHeadBytes) return;
  frame.image.data = body.data();
  pool.slot = (pool.slot + 1) % kImageSlots;
}

bool RecordingSource::mapScene(std::size_t i, SceneImages& scene) {
  scene = {};
  if (i >= index_.scenes.size() || index_.scenes[i].length == kMapStepHeadBytes) return false;
  const RecordedScene& entry = index_.scenes[i];
  std::array<std::uint8_t, kRecordHeaderBytes + kMapStepHeadBytes> head{};
  // NOLINTNEXTLINE(cppcoreguidelines-pro-type-reinterpret-cast): bytes of the floats that they are
  const std::span<std::uint8_t> body(reinterpret_cast<std::uint8_t*>(scene_.data()), bodyBytes(entry));
  readSound(entry, head, body);
  LittleFieldReader from{std::span(head).subspan<kRecordHeaderBytes + kMapStepSceneAt>()};
  scene.stamp.ns = from.i64();
  const Stamp depth_stamp{from.i64()};
  PinholeIntrinsics depth;
  depth.width = from.i32();
  depth.height = from.i32();
  ImageView labels;
  labels.width = from.i32();
  labels.height = from.i32();
  // Header and payload are valid, but the file may have been replaced since it was indexed.
  const std::size_t depth_bytes = sizeof(float) * depth.pixels();
  const auto label_bytes = static_cast<std::size_t>(labels.width) * static_cast<std::size_t>(labels.height);
  if (kMapStepHeadBytes + depth_bytes + label_bytes != entry.length) refuseChanged(entry);
  if (depth_bytes > 0) {
    if (!index_.header.depth_sensor) refuseChanged(entry);
    scene.depth = *index_.header.depth_sensor;
    if (depth.width != scene.depth.camera.width || depth.height != scene.depth.camera.height) {
      refuseChanged(entry);
    }
    scene.depth.stamp = depth_stamp;
    scene.depth.depth = scene_.data();
  }
  if (label_bytes > 0) {
    labels.stride = labels.width;
    labels.data = body.data() + depth_bytes;
    scene.labels = labels;
  }
  return true;
}

/// Reads the record of `entry` into `head` and `body` and verifies it again.
template <typename Entry>
void RecordingSource::readSound(const Entry& entry, std::span<std::uint8_t> head,
                                std::span<std::uint8_t> body) const {
  const RecordingFile& file = *files_.segments[entry.segment];
  RecordHeader header;
  const bool head_there = file.read(entry.offset, head) == head.size();
  if (!head_there || !decode(head.first<kRecordHeaderBytes>(), index_.run_checksum, header) ||
      header.length != entry.length) {
    refuseChanged(entry);
  }
  const std::size_t got = file.read(entry.offset + head.size(), body);
  const std::uint32_t crc = crc32c(index_.run_checksum, head.subspan(kRecordHeaderBytes));
  if (got != body.size() || crc32c(crc, body) != header.payload_crc) refuseChanged(entry);
}

template <typename Entry>
void RecordingSource::refuseChanged(const Entry& entry) const {
  throw InputError(files_.segments[entry.segment]->name(), 0, fmt::format("byte {}", entry.offset),
                   "this record was intact when the recording was opened and is damaged now",
                   "The file was changed or the disk is failing; open it again to see what is left");
}

bool isRecording(const std::string& path) { return !findRecordingFolder(path).empty(); }

std::unique_ptr<RecordingSource> openRecording(const std::string& path, const LogOptions& options) {
  const std::string folder = findRecordingFolder(path);
  if (folder.empty()) {
    throw InputError(path, 0, "",
                     "contains no recording: recording_*.swr files are neither here nor in `recording`",
                     "Give a run folder or its recording");
  }
  return std::make_unique<RecordingSource>(listRecordingFiles(folder), options, folder);
}

}  // namespace swiftlet
