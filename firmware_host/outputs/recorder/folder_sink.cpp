#include "firmware_host/outputs/recorder/folder_sink.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <stdexcept>

#include "drivers/input/input_error.hpp"
#include "drivers/recorded/asl_text.hpp"
#include "drivers/recorded/image_files.hpp"
#include "firmware_host/interfaces/packed_copy.hpp"
#include "firmware_host/realtime/host_sleep.hpp"

namespace swiftlet {
namespace {

constexpr const char* kOrigin = "recorded by swiftlet record; stamps of CLOCK_MONOTONIC";
/// The writers look this often: their rings hold a second and more.
constexpr Duration kPeriod = Duration::fromMilliseconds(5);

std::ofstream openRows(const std::filesystem::path& path, const std::string& header) {
  std::ofstream file(path, std::ios::binary);
  file << header;
  if (!file) {
    throw InputError(path.string(), 0, "", "cannot be written", "Give an --out that this user may write to");
  }
  return file;
}

}  // namespace

FolderSink::FolderSink(const std::string& folder, const Calibration& calibration, double camera_rate)
    : folder_(folder), cameras_(calibration.rig.camera_count) {
  if (std::filesystem::exists(std::filesystem::path(folder) / "mav0")) {
    throw InputError(folder, 0, "", "holds a recording already", "Give another --out, or move it away");
  }
  openImu(calibration);
  for (std::size_t c = 0; c < cameras_; ++c) openCamera(c, calibration, camera_rate);
  writer_ = std::thread([this] { write([this] { writeSamples(); }, error_); });
  for (std::size_t c = 0; c < cameras_; ++c) {
    Camera& camera = camera_[c];
    camera.writer = std::thread([this, &camera] { write([&] { writeImages(camera); }, camera.error); });
  }
}

FolderSink::~FolderSink() {
  ended_.store(true);
  if (writer_.joinable()) writer_.join();
  for (Camera& camera : camera_) {
    if (camera.writer.joinable()) camera.writer.join();
  }
}

void FolderSink::openImu(const Calibration& calibration) {
  const std::filesystem::path folder = std::filesystem::path(folder_) / "mav0" / "imu0";
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  openRows(folder / "sensor.yaml", imuYaml(calibration.noise, kOrigin));
  rows_ = openRows(folder / "data.csv", imuCsvHeader());
}

void FolderSink::openCamera(std::size_t index, const Calibration& calibration, double rate) {
  const std::filesystem::path folder =
      std::filesystem::path(folder_) / "mav0" / ("cam" + std::to_string(index));
  std::error_code error;
  std::filesystem::create_directories(folder / "data", error);
  const CameraModel& model = calibration.rig.camera[index];
  Camera& camera = camera_[index];
  camera.folder = (folder / "data").string();
  camera.width = model.width();
  camera.height = model.height();
  const std::string times =
      fmt::format("timeshift_cam_imu: {:.9f}\n", calibration.rig.camera_to_imu_shift.seconds()) +
      shutterYaml(calibration.rig.readout);
  openRows(folder / "sensor.yaml",
           cameraYaml(model, calibration.rig.T_body_cam[index], rate, kOrigin, times));
  camera.rows = openRows(folder / "data.csv", "#timestamp [ns],filename\n");
  // Each slot once around, so that none grows later.
  for (std::size_t i = 0; i < kImagesAhead; ++i) {
    camera.images.beginPush()->pixels.resize(static_cast<std::size_t>(model.width()) *
                                             static_cast<std::size_t>(model.height()));
    camera.images.commitPush();
  }
  while (camera.images.front() != nullptr) camera.images.pop();
}

void FolderSink::takeImu(const ImuSample& sample, Stamp /*arrival*/, const HostTimes& /*host*/) {
  samples_taken_.fetch_add(1, std::memory_order_relaxed);
  static_cast<void>(samples_.tryPush(sample));
}

void FolderSink::takeImage(const CameraFrame& image, const HostTimes& /*host*/) {
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

template <typename Work>
void FolderSink::write(Work&& work, std::string& error) {
  try {
    work();
  } catch (const std::exception& failed) {
    error = failed.what();
    failed_.store(true);
  }
}

void FolderSink::writeImages(Camera& camera) {
  for (;;) {
    const bool ended = ended_.load();
    const Image* image = camera.images.front();
    if (image == nullptr) {
      if (ended) break;
      sleepFor(kPeriod);
      continue;
    }
    const std::string name = std::to_string(image->stamp.ns) + ".png";
    writePng8(camera.folder + "/" + name, image->pixels.data(), camera.width, camera.height);
    camera.rows << image->stamp.ns << ',' << name << '\n' << std::flush;
    if (!camera.rows) throw std::runtime_error(camera.folder + ": data.csv cannot be written");
    camera.images.pop();
  }
}

void FolderSink::writeSamples() {
  for (;;) {
    const bool ended = ended_.load();
    ImuSample sample;
    bool any = false;
    while (samples_.tryPop(sample)) {
      rows_ << imuCsvRow(sample);
      any = true;
    }
    rows_ << std::flush;
    if (!rows_) throw std::runtime_error(folder_ + "/mav0/imu0/data.csv: cannot be written");
    if (any) continue;
    if (ended) break;
    sleepFor(kPeriod);
  }
}

void FolderSink::finish() {
  ended_.store(true);
  writer_.join();
  for (std::size_t c = 0; c < cameras_; ++c) camera_[c].writer.join();
  std::string error = error_;
  for (const Camera& camera : camera_) {
    if (error.empty()) error = camera.error;
  }
  if (!error.empty()) {
    throw InputError(folder_, 0, "", "writing ended before the recording did: " + error,
                     "Make room on the disk, or give an --out elsewhere");
  }
}

FolderSink::Counters FolderSink::counters() const {
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
