#include "tests/fuzz/fuzz_recording.hpp"

#include <algorithm>
#include <string>
#include <vector>

#include "drivers/recorded/recording_checksum.hpp"
#include "drivers/recorded/recording_source.hpp"
#include "tests/fuzz/demand.hpp"

namespace swiftlet::fuzz {
namespace {

using Bytes = std::vector<std::uint8_t>;

class MemorySegment final : public RecordingFile {
 public:
  explicit MemorySegment(Bytes bytes) : bytes_(std::move(bytes)) {}
  [[nodiscard]] const std::string& name() const override { return name_; }
  [[nodiscard]] std::uint64_t size() const override { return bytes_.size(); }
  std::size_t read(std::uint64_t offset, std::span<std::uint8_t> out) const override {
    demand(offset <= bytes_.size());
    const std::size_t count = std::min(out.size(), bytes_.size() - static_cast<std::size_t>(offset));
    std::copy_n(bytes_.begin() + static_cast<std::ptrdiff_t>(offset), count, out.begin());
    return count;
  }

 private:
  std::string name_ = "segment";
  Bytes bytes_;
};

std::vector<Bytes> split(std::string_view text) {
  const std::string_view magic(reinterpret_cast<const char*>(kSegmentMagic.data()), kSegmentMagic.size());
  std::vector<Bytes> segments;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find(magic, 1), text.size());
    segments.emplace_back(text.begin(), text.begin() + end);
    text.remove_prefix(end);
  }
  return segments;
}

/// Makes checksums, marks and sequence numbers right as far as lengths lead from record to record.
void repair(std::vector<Bytes>& segments) {
  std::uint64_t sequence = 0;
  std::uint32_t run_checksum = 0;
  for (std::size_t i = 0; i < segments.size(); ++i) {
    Bytes& bytes = segments[i];
    if (bytes.size() < kSegmentHeaderBytes) return;
    const std::span<std::uint8_t, kSegmentHeaderBytes> head(bytes.data(), kSegmentHeaderBytes);
    SegmentHeader segment;
    if (decode(head, segment) == SegmentHeaderState::kForeign) return;
    if (i == 0) run_checksum = runChecksum(segment.run);
    segment.first_sequence = sequence;
    encode(segment, head);
    std::size_t at = kSegmentHeaderBytes;
    while (bytes.size() - at >= kRecordHeaderBytes) {
      const std::span<std::uint8_t, kRecordHeaderBytes> place(bytes.data() + at, kRecordHeaderBytes);
      RecordHeader header;
      (void)decode(place, run_checksum, header);
      const std::size_t size = paddedSize(header.length);
      if (size > bytes.size() - at - kRecordHeaderBytes) break;
      header.sequence = sequence++;
      header.payload_crc = crc32c(run_checksum, {bytes.data() + at + kRecordHeaderBytes, size});
      encode(header, run_checksum, place);
      at += kRecordHeaderBytes + size;
    }
  }
}

void read(const std::vector<Bytes>& segments) {
  RecordingFiles files;
  files.folder = "recording";
  for (const Bytes& bytes : segments) files.segments.push_back(std::make_unique<MemorySegment>(bytes));
  try {
    RecordingSource source(std::move(files), {});
    SensorMessage message;
    std::size_t samples = 0;
    std::size_t images = 0;
    unsigned sum = 0;
    while (source.next(message)) {
      const auto* frame = std::get_if<CameraFrame>(&message);
      samples += frame == nullptr ? 1 : 0;
      images += frame == nullptr ? 0 : 1;
      if (frame == nullptr || frame->image.empty()) continue;
      demand(frame->camera < kMaxCameras && frame->image.stride >= frame->image.width);
      for (int y = 0; y < frame->image.height; ++y) {
        for (int x = 0; x < frame->image.width; ++x) sum += frame->image.row(y)[x];
      }
    }
    demand(samples == source.imuCount() && images == source.imageCount());
    for (std::size_t i = 0; i < source.steps().map.size(); ++i) {
      SceneImages scene;
      if (!source.mapScene(i, scene)) continue;
      demand(!scene.empty());
      const std::size_t depths = scene.depth.depth != nullptr ? scene.depth.camera.pixels() : 0;
      for (std::size_t k = 0; k < depths; ++k) sum += scene.depth.depth[k] > 0 ? 1U : 0U;
      for (int y = 0; !scene.labels.empty() && y < scene.labels.height; ++y) {
        for (int x = 0; x < scene.labels.width; ++x) sum += scene.labels.row(y)[x];
      }
    }
    demand(source.firstLoss().has_value() == !source.losses().empty());
    // Keeps the reading of the pixels alive.
    volatile unsigned sink = sum;
    (void)sink;
    for (std::size_t i = 1; i < samples; ++i) demand(source.imuNumber(i - 1) < source.imuNumber(i));
    for (std::size_t camera = 0; camera < kMaxCameras; ++camera) {
      CameraFrame frame;
      const std::uint64_t last = source.lastImage(camera);
      demand(last == 0 || source.image(camera, last, frame));
      demand(!source.image(camera, last + 1, frame));
    }
  } catch (const InputError&) {
  }
}

}  // namespace

void recording(std::string_view text) {
  std::vector<Bytes> segments = split(text);
  read(segments);
  repair(segments);
  read(segments);
}

}  // namespace swiftlet::fuzz
