#include "firmware_host/outputs/recorder/mcap_sink.hpp"

#include <filesystem>

#include "drivers/input/input_error.hpp"
#include "drivers/recorded/log_messages.hpp"

namespace swiftlet {
namespace {

const std::string& unused(const std::string& file) {
  if (!std::filesystem::exists(file)) return file;
  throw InputError(file, 0, "", "already exists", "Give another name, or move the file away");
}

}  // namespace

McapSink::McapSink(const std::string& file, const Calibration& calibration)
    : RecordSink(file, calibration), bag_(makeMcapWriter(unused(file), McapPacking::kZstd)) {
  for (std::size_t c = 0; c < cameras(); ++c) {
    info_[c] = cameraInfoOf(calibration.rig.camera[c]);
    if (!calibration.bare) continue;
    // In ROS, CameraInfo with nothing but a size means an uncalibrated camera.
    info_[c].distortion_model.clear();
    info_[c].d.clear();
    info_[c].k = {};
    info_[c].p = {};
  }
  startWriter([this] { return writeWaiting(); });
}

bool McapSink::writeWaiting() {
  bool any = false;
  ImuSample sample;
  while (nextSample(sample)) {
    writeImu(bag_, sample);
    any = true;
  }
  for (std::size_t c = 0; c < cameras(); ++c) {
    const Image* image = waitingImage(c);
    if (image == nullptr) continue;
    writePixels(bag_, c, image->stamp, image->pixels, info_[c]);
    dropImage(c);
    any = true;
  }
  return any;
}

}  // namespace swiftlet
