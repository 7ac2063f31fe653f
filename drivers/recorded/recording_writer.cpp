#include "drivers/recorded/recording_writer.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/random.h>
#include <sys/uio.h>
#include <unistd.h>

#include <algorithm>
#include <bit>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <system_error>

#include "drivers/device/byte_fields.hpp"
#include "drivers/input/input_error.hpp"
#include "drivers/recorded/recording_checksum.hpp"

namespace swiftlet {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMinBufferBytes = 128U << 10U;
// From this size on, copying the pixels again costs more than a system call.
constexpr std::size_t kDirectBytes = 32U << 10U;
// Rows per system call, for an image with row padding.
constexpr std::size_t kPiecesPerCall = 64;
constexpr mode_t kFileMode = 0644;
constexpr std::array<std::uint8_t, kRecordAlignment> kPadding{};

constexpr Status kEnded{StatusCode::kInvalidInput, "the recording has ended"};

Status statusOf(int error) {
  switch (error) {
    case ENOSPC:
    case EDQUOT:
      return {StatusCode::kFailed, "the disk is full: recording stopped; free space before the next run"};
    case EFBIG:
      return {StatusCode::kFailed, "a file exceeded the allowed size: recording stopped; see ulimit -f"};
    default:
      return {StatusCode::kFailed, "the disk accepts no more data: recording stopped; see dmesg"};
  }
}

/// iovec has no const: the kernel only reads `piece`.
iovec readOnly(std::span<const std::uint8_t> piece) {
  return {const_cast<std::uint8_t*>(piece.data()), piece.size()};
}

void appendEffort(LittleFieldWriter& to, const Effort& effort) {
  to.i32(effort.iterations);
  to.i32(effort.features);
  to.i32(effort.keyframes);
  to.i32(0);  // room for one more
}

}  // namespace

RecordingWriter::RecordingWriter(const std::string& folder, const RecordingHeader& header,
                                 const RecordingOptions& options)
    : buffer_(std::max(options.buffer_bytes, kMinBufferBytes)),
      segment_bytes_(options.segment_bytes),
      depth_sensor_(header.depth_sensor) {
  try {
    const std::vector<std::uint8_t> run = encodeRecordingHeader(header);
    RecordingHeader read_back;
    if (const char* field = decodeRecordingHeader(run, read_back)) {
      throw InputError(folder, 0, field, "cannot be recorded", "Check the calibration");
    }
    if (kRecordHeaderBytes + paddedSize(run.size()) > buffer_.size()) buffer_.resize(2 * run.size());
    openFolder(folder);
    removeEarlierRun(folder);
    if (::getrandom(run_.data(), run_.size(), 0) != static_cast<ssize_t>(run_.size())) {
      throw InputError(folder, 0, "", "the system provides no random numbers for the run's id",
                       "See getrandom(2)");
    }
    run_checksum_ = runChecksum(run_);
    int error = beginSegment();
    if (error == 0) {
      put(RecordKind::kRun, run.data(), run.size());
      sync();
      if (!status_.ok()) error = EIO;
    }
    if (error != 0) {
      const char* what = status_.ok() ? std::strerror(error) : status_.what;
      throw InputError(folder, 0, "", std::string("cannot write a recording here: ") + what,
                       "Give a writable folder on a disk with free space");
    }
    // Sync the entry of the new folder; ignore file systems that cannot sync folders.
    const int parent = ::openat(folder_, "..", O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (parent >= 0) {
      (void)::fsync(parent);
      ::close(parent);
    }
  } catch (...) {
    closeFiles();
    throw;
  }
}

RecordingWriter::~RecordingWriter() {
  flush();
  closeFiles();
}

void RecordingWriter::openFolder(const std::string& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  folder_ = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (folder_ < 0) {
    throw InputError(folder, 0, "",
                     std::string("cannot write a recording here: ") +
                         (error ? error.message() : std::string(std::strerror(errno))),
                     "Give a writable folder or the name of a new one");
  }
  if (::flock(folder_, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK) {
    throw InputError(folder, 0, "", "another program is writing or reading this recording",
                     "Give another folder, or wait until that program ends");
  }
}

void RecordingWriter::removeEarlierRun(const std::string& folder) {
  std::vector<std::string> names;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    std::uint32_t segment = 0;
    const std::string name = entry.path().filename().string();
    if (parseSegmentName(name, segment)) names.push_back(name);
  }
  // Delete the last segment first: an interruption then leaves the beginning of the old run, not a run with
  // gaps.
  std::sort(names.rbegin(), names.rend());
  for (const std::string& name : names) {
    if (::unlinkat(folder_, name.c_str(), 0) == 0) continue;
    throw InputError(
        (fs::path(folder) / name).string(), 0, "",
        std::string("a segment of an earlier recording cannot be removed: ") + std::strerror(errno),
        "Give another folder");
  }
}

int RecordingWriter::beginSegment() {
  if (segment_ >= kMaxSegments) return EFBIG;
  const SegmentName name = segmentName(segment_);
  file_ = ::openat(folder_, name.data(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, kFileMode);
  if (file_ < 0) return errno;
  SegmentHeader header;
  header.segment = segment_;
  header.run = run_;
  header.first_sequence = sequence_;
  std::array<std::uint8_t, kSegmentHeaderBytes> bytes{};
  encode(header, bytes);
  iovec piece = readOnly(bytes);
  const WriteResult result = writeAll(&piece, 1);
  if (result.error != 0) {
    // Do not leave an empty segment.
    ::unlinkat(folder_, name.data(), 0);
    ::close(file_);
    file_ = -1;
    return result.error;
  }
  // Without this, a synced file could still be lost in a power cut with its directory entry.
  (void)::fsync(folder_);
  offset_ = bytes.size();
  ++statistics_.segments;
  statistics_.bytes += bytes.size();
  return 0;
}

void RecordingWriter::closeFiles() {
  if (file_ >= 0) ::close(file_);
  if (folder_ >= 0) ::close(folder_);
  file_ = -1;
  folder_ = -1;
}

Status RecordingWriter::imu(const ImuSample& sample, Stamp arrival) {
  std::array<std::uint8_t, kImuPayloadBytes> payload{};
  LittleFieldWriter to(payload);
  to.i64(sample.stamp.ns);
  to.i64(arrival.ns);
  for (int i = 0; i < 3; ++i) to.f64(sample.gyro[i]);
  for (int i = 0; i < 3; ++i) to.f64(sample.accel[i]);
  return put(RecordKind::kImu, payload.data(), payload.size());
}

/// An image without row padding is treated as one row.
RecordingWriter::Pixels RecordingWriter::pixelsOf(const ImageView& image) {
  if (image.empty()) return {};
  const auto width = static_cast<std::size_t>(image.width);
  const auto height = static_cast<std::size_t>(image.height);
  if (image.stride == image.width) return {image.data, width * height, 0, 1};
  return {image.data, width, static_cast<std::size_t>(image.stride), height};
}

Status RecordingWriter::image(const CameraFrame& frame) {
  const Pixels pixels = pixelsOf(frame.image);
  const RecordKind kind = imageKind(frame.camera);
  if (frame.camera >= kMaxCameras || kImageHeadBytes + pixels.bytes() > kMaxPayloadBytes) {
    ++statistics_.lost[static_cast<std::size_t>(kind)];
    return {StatusCode::kInvalidInput, "an image of a camera that is not in the rig, or too large to record"};
  }
  std::array<std::uint8_t, kImageHeadBytes> head{};
  LittleFieldWriter to(head);
  to.i64(frame.stamp.ns);
  to.i64(frame.arrival.ns);
  to.u64(frame.sequence);
  to.i32(frame.image.width);
  to.i32(frame.image.height);
  to.u32(static_cast<std::uint32_t>(frame.clock));
  to.u32(0);
  return putPixels(kind, head, {&pixels, 1});
}

Status RecordingWriter::mapStep(const MapStep& step, const SceneImages& scene) {
  // Depth is written as it lies in memory.
  static_assert(std::endian::native == std::endian::little);
  const bool depth = scene.depth.depth != nullptr;
  const PinholeIntrinsics& camera = scene.depth.camera;
  std::array<Pixels, 2> planes{};
  bool fits = true;
  if (depth) {
    fits = depth_sensor_ && camera.width == depth_sensor_->camera.width &&
           camera.height == depth_sensor_->camera.height;
    planes[0] = {reinterpret_cast<const std::uint8_t*>(scene.depth.depth),
                 fits ? sizeof(float) * camera.pixels() : 0, 0, 1};
  }
  planes[1] = pixelsOf(scene.labels);
  if (!fits || kMapStepHeadBytes + planes[0].bytes() + planes[1].bytes() > kMaxPayloadBytes) {
    ++statistics_.lost[static_cast<std::size_t>(RecordKind::kMapStep)];
    return {StatusCode::kInvalidInput, "a depth image of another sensor, or a scene too large to record"};
  }
  const bool labels = !scene.labels.empty();
  std::array<std::uint8_t, kMapStepHeadBytes> head{};
  LittleFieldWriter to(head);
  to.u64(step.frame);
  to.u64(step.correction);
  to.u64(step.spare_turns);
  for (const std::uint64_t image : step.image) to.u64(image);
  to.u32(step.end ? 1 : 0);
  to.u32(0);
  to.i64(scene.stamp.ns);
  to.i64(depth ? scene.depth.stamp.ns : 0);
  to.i32(depth ? camera.width : 0);
  to.i32(depth ? camera.height : 0);
  to.i32(labels ? scene.labels.width : 0);
  to.i32(labels ? scene.labels.height : 0);
  return putPixels(RecordKind::kMapStep, head, planes);
}

Status RecordingWriter::putPixels(RecordKind kind, std::span<const std::uint8_t> head,
                                  std::span<const Pixels> planes) {
  if (!status_.ok() || ended_) return refuse(kind);
  std::size_t pixels = 0;
  for (const Pixels& plane : planes) pixels += plane.bytes();
  const std::size_t payload = head.size() + pixels;
  const std::size_t padding = paddedSize(payload) - payload;
  const bool direct = pixels >= kDirectBytes;
  if (!makeRoom(kRecordHeaderBytes + paddedSize(payload))) return refuse(kind);
  const std::size_t in_buffer = kRecordHeaderBytes + (direct ? head.size() : paddedSize(payload));
  if (!fitsBuffer(in_buffer) && !flushBuffer()) return refuse(kind);

  RecordHeader header{kind, sequence_, static_cast<std::uint32_t>(payload), crc32c(run_checksum_, head)};
  for (const Pixels& plane : planes) {
    for (std::size_t y = 0; y < plane.rows; ++y) {
      header.payload_crc = crc32c(header.payload_crc, plane.row(y));
    }
  }
  header.payload_crc = crc32c(header.payload_crc, {kPadding.data(), padding});
  if (direct) return putDirect(header, head, planes);

  appendHeader(header);
  LittleFieldWriter body{std::span(buffer_).subspan(filled_)};
  body.copy(head);
  for (const Pixels& plane : planes) {
    for (std::size_t y = 0; y < plane.rows; ++y) body.copy(plane.row(y));
  }
  body.zeros(padding);
  filled_ += body.written().size();
  return okStatus();
}

/// Writes the buffer and then the pixels, from the caller's memory, to the kernel.
Status RecordingWriter::putDirect(const RecordHeader& header, std::span<const std::uint8_t> head,
                                  std::span<const Pixels> planes) {
  appendHeader(header);
  std::memcpy(buffer_.data() + filled_, head.data(), head.size());
  filled_ += head.size();

  std::array<iovec, kPiecesPerCall> pieces{};
  std::size_t count = 0;
  std::size_t written = 0;
  const auto flushPieces = [&] {
    const WriteResult result = writeAll(pieces.data(), count);
    written += result.written;
    count = 0;
    if (result.error == 0) return true;
    loseBuffer(written);
    fail(result.error);
    return false;
  };
  pieces[count++] = readOnly({buffer_.data(), filled_});
  for (const Pixels& plane : planes) {
    for (std::size_t y = 0; y < plane.rows; ++y) {
      if (count == pieces.size() && !flushPieces()) return status_;
      pieces[count++] = readOnly(plane.row(y));
    }
  }
  if (count == pieces.size() && !flushPieces()) return status_;
  pieces[count++] = readOnly({kPadding.data(), paddedSize(header.length) - header.length});
  if (!flushPieces()) return status_;
  offset_ += written;
  filled_ = 0;
  return okStatus();
}

Status RecordingWriter::propagateStep(const PropagateStep& step) {
  std::array<std::uint8_t, kPropagateStepBytes> payload{};
  LittleFieldWriter to(payload);
  to.u64(step.samples);
  to.u64(step.fix);
  return put(RecordKind::kPropagateStep, payload.data(), payload.size());
}

Status RecordingWriter::trackStep(const TrackStep& step) {
  std::array<std::uint8_t, kTrackStepBytes> payload{};
  LittleFieldWriter to(payload);
  to.u64(step.frame);
  to.i64(step.stamp.ns);
  for (const std::uint64_t image : step.image) to.u64(image);
  to.u64(step.samples);
  to.u64(step.window);
  appendEffort(to, step.effort);
  return put(RecordKind::kTrackStep, payload.data(), payload.size());
}

Status RecordingWriter::smoothStep(const SmoothStep& step) {
  std::array<std::uint8_t, kSmoothStepBytes> payload{};
  LittleFieldWriter to(payload);
  to.u64(step.frame);
  to.u64(step.samples);
  appendEffort(to, step.effort);
  to.u64(step.planes);
  return put(RecordKind::kSmoothStep, payload.data(), payload.size());
}

Status RecordingWriter::meshStep(const MeshStep& step) {
  std::array<std::uint8_t, kMeshStepBytes> payload{};
  LittleFieldWriter to(payload);
  to.u64(step.frame);
  to.u64(step.window);
  to.u64(step.image);
  return put(RecordKind::kMeshStep, payload.data(), payload.size());
}

Status RecordingWriter::loopStep(const LoopStep& step) {
  std::array<std::uint8_t, kLoopStepBytes> payload{};
  LittleFieldWriter to(payload);
  to.u64(step.frame);
  to.u64(step.window);
  for (const std::uint64_t image : step.image) to.u64(image);
  return put(RecordKind::kLoopStep, payload.data(), payload.size());
}

Status RecordingWriter::loss(RecordKind kind, std::uint64_t count) {
  if (count == 0) return status_;
  if (!canBeLost(kind)) {
    return {StatusCode::kInvalidInput, "only messages and steps can be lost"};
  }
  std::array<std::uint8_t, kLossBytes> payload{};
  LittleFieldWriter to(payload);
  to.u32(static_cast<std::uint32_t>(kind));
  to.u32(0);
  to.u64(count);
  return put(RecordKind::kLoss, payload.data(), payload.size());
}

Status RecordingWriter::flush() {
  if (status_.ok() && !ended_) flushBuffer();
  return status_;
}

Status RecordingWriter::sync() {
  if (!status_.ok() || ended_ || !flushBuffer()) return status_;
  if (::fdatasync(file_) != 0) {
    fail(errno);
  } else {
    ++statistics_.syncs;
  }
  return status_;
}

Status RecordingWriter::end() {
  if (ended_) return status_;
  std::array<std::uint8_t, kEndBytes> payload{};
  LittleFieldWriter(payload).u64(sequence_);
  put(RecordKind::kEnd, payload.data(), payload.size());
  sync();
  ended_ = true;
  closeFiles();
  return status_;
}

Status RecordingWriter::put(RecordKind kind, const std::uint8_t* payload, std::size_t size) {
  if (!status_.ok() || ended_) return refuse(kind);
  const std::size_t padded = paddedSize(size);
  if (!makeRoom(kRecordHeaderBytes + padded)) return refuse(kind);
  if (!fitsBuffer(kRecordHeaderBytes + padded) && !flushBuffer()) return refuse(kind);
  std::uint32_t crc = crc32c(run_checksum_, {payload, size});
  crc = crc32c(crc, {kPadding.data(), padded - size});
  appendHeader({kind, sequence_, static_cast<std::uint32_t>(size), crc});
  LittleFieldWriter to{std::span(buffer_).subspan(filled_)};
  to.copy({payload, size});
  to.zeros(padded - size);
  filled_ += padded;
  return okStatus();
}

/// Also counts the record; its payload must follow.
void RecordingWriter::appendHeader(const RecordHeader& header) {
  encode(header, run_checksum_,
         std::span<std::uint8_t, kRecordHeaderBytes>(buffer_.data() + filled_, kRecordHeaderBytes));
  filled_ += kRecordHeaderBytes;
  ++sequence_;
  ++statistics_.records;
  statistics_.bytes += kRecordHeaderBytes + paddedSize(header.length);
}

/// Starts the next segment if a record of `bytes` would not fit in this one.
bool RecordingWriter::makeRoom(std::size_t bytes) {
  const std::uint64_t used = offset_ + filled_;
  if (used + bytes <= segment_bytes_ || used == kSegmentHeaderBytes) return true;
  if (!sync().ok()) return false;
  ::close(file_);
  file_ = -1;
  ++segment_;
  const int error = beginSegment();
  if (error != 0) fail(error);
  return error == 0;
}

RecordingWriter::WriteResult RecordingWriter::writeAll(iovec* pieces, std::size_t count) const {
  WriteResult result;
  while (count > 0) {
    if (pieces->iov_len == 0) {
      ++pieces;
      --count;
      continue;
    }
    const ssize_t got = ::writev(file_, pieces, static_cast<int>(count));
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) {
      result.error = got < 0 ? errno : EIO;
      return result;
    }
    auto left = static_cast<std::size_t>(got);
    result.written += left;
    while (left > 0) {
      const std::size_t step = std::min(left, pieces->iov_len);
      pieces->iov_base = static_cast<std::uint8_t*>(pieces->iov_base) + step;
      pieces->iov_len -= step;
      left -= step;
      if (pieces->iov_len > 0) continue;
      ++pieces;
      --count;
    }
  }
  return result;
}

bool RecordingWriter::flushBuffer() {
  iovec piece{buffer_.data(), filled_};
  const WriteResult result = writeAll(&piece, 1);
  if (result.error != 0) {
    loseBuffer(result.written);
    fail(result.error);
    return false;
  }
  offset_ += filled_;
  filled_ = 0;
  return true;
}

/// Only the first `written` bytes of the buffer (and of what should have followed it) reached the file:
/// counts the records that did not, and cuts the file after the last complete record.
void RecordingWriter::loseBuffer(std::size_t written) {
  std::size_t kept = 0;
  std::size_t at = 0;
  while (at < filled_) {
    LittleFieldReader from(std::span<const std::uint8_t>(buffer_).subspan(at + 16, 6));
    const std::size_t size = kRecordHeaderBytes + paddedSize(from.u32());
    const std::uint16_t kind = from.u16();
    at += size;
    if (at <= std::min(written, filled_)) {
      kept = at;
      continue;
    }
    ++statistics_.lost[kind];
    --statistics_.records;
    statistics_.bytes -= size;
  }
  offset_ += kept;
  filled_ = 0;
  // If this fails too, readers cut the recording at the same place.
  if (::ftruncate(file_, static_cast<off_t>(offset_)) != 0) errno = 0;
}

void RecordingWriter::fail(int error) {
  if (status_.ok()) status_ = statusOf(error);
}

Status RecordingWriter::refuse(RecordKind kind) {
  ++statistics_.lost[static_cast<std::size_t>(kind)];
  return status_.ok() ? kEnded : status_;
}

}  // namespace swiftlet
