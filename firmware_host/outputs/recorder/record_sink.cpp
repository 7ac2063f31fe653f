#include "firmware_host/outputs/recorder/record_sink.hpp"

#include <exception>
#include <utility>

#include "drivers/input/input_error.hpp"
#include "firmware_host/interfaces/packed_copy.hpp"
#include "firmware_host/realtime/host_sleep.hpp"

namespace swiftlet {
namespace {

/// Period at which writers look for messages; the rings hold a second and more.
constexpr Duration kPeriod = Duration::fromMilliseconds(5);

}  // namespace

RecordSink::RecordSink(std::string out, const Calibration& calibration)
    : out_(std::move(out)),
      cameras_(calibration.rig.camera_count),
      to_readings_(calibration.imuCorrection().inverse()) {
  for (std::size_t c = 0; c < cameras_; ++c) reserve(camera_[c], calibration.rig.camera[c]);
}

void RecordSink::reserve(Camera& camera, const CameraModel& model) {
  camera.width = model.width();
  camera.height = model.height();
  // Resizes every slot once, so that none grows later.
  for (std::size_t i = 0; i < kImagesAhead; ++i) {
    camera.images.beginPush()->pixels.resize(static_cast<std::size_t>(model.width()) *
                                             static_cast<std::size_t>(model.height()));
    camera.images.commitPush();
  }
  while (camera.images.front() != nullptr) camera.images.pop();
}

void RecordSink::startWriter(std::function<bool()> step) {
  Writer& writer = writers_[writer_count_++];
  writer.thread = std::thread([this, &writer, step = std::move(step)] { write(step, writer.error); });
}

void RecordSink::write(const std::function<bool()>& step, std::string& error) {
  try {
    for (;;) {
      const bool ended = ended_.load();
      if (step()) continue;
      if (ended) return;
      sleepFor(kPeriod);
    }
  } catch (const std::exception& failed) {
    error = failed.what();
    failed_.store(true);
  }
}

void RecordSink::stopWriters() {
  ended_.store(true);
  for (Writer& writer : writers_) {
    if (writer.thread.joinable()) writer.thread.join();
  }
}

void RecordSink::takeImu(const ImuSample& sample, Stamp /*arrival*/, const HostTimes& /*host*/) {
  samples_taken_.fetch_add(1, std::memory_order_relaxed);
  static_cast<void>(samples_.tryPush(sample));
}

void RecordSink::takeImage(const CameraFrame& image, const HostTimes& /*host*/) {
  if (image.camera >= cameras_) return;
  Camera& camera = camera_[image.camera];
  if (image.image.width != camera.width || image.image.height != camera.height) return;
  camera.taken.fetch_add(1, std::memory_order_relaxed);
  Image* slot = camera.images.beginPush();
  if (slot == nullptr) return;
  slot->stamp = image.stamp;
  packedCopy(image.image, slot->pixels.data());
  camera.images.commitPush();
}

void RecordSink::finish() {
  stopWriters();
  std::string error;
  for (const Writer& writer : writers_) {
    if (error.empty()) error = writer.error;
  }
  if (!error.empty()) {
    throw InputError(out_, 0, "", "writing stopped before the recording ended: " + error,
                     "Free space on the disk, or give an --out on another disk");
  }
  close();
}

RecordSink::Counters RecordSink::counters() const {
  Counters counters;
  counters.samples_lost = samples_.refused();
  counters.samples = samples_taken_.load() - counters.samples_lost;
  for (std::size_t c = 0; c < cameras_; ++c) {
    counters.images_lost[c] = camera_[c].images.refused();
    counters.images[c] = camera_[c].taken.load() - counters.images_lost[c];
  }
  return counters;
}

}  // namespace swiftlet
