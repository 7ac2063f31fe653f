#include "firmware_host/lab/report/log_images.hpp"

#include <algorithm>
#include <filesystem>
#include <system_error>
#include <variant>

#include "drivers/input/input_error.hpp"
#include "drivers/recorded/open_log.hpp"
#include "drivers/recorded/recording_source.hpp"

namespace swiftlet {
namespace {

// In a recording, images come after newer samples, because of exposure, transfer and decoding.
constexpr Duration kMostDelay = Duration::fromSeconds(5);

}  // namespace

LogImages::LogImages(const std::string& log, bool mono, Stamp first, Stamp last)
    : first_(first), last_(last) {
  LogOptions options;
  options.mono = mono;
  options.wants_image = [this](Stamp stamp, std::uint32_t camera) { return wants(stamp, camera); };
  try {
    log_ = openLog(log, options);
  } catch (const InputError&) {
    // A bag has no calibration, and other logs may lack it; showing images needs none.
    options.uncalibrated = true;
    calibrated_ = false;
    log_ = openLog(log, options);
  }
  SensorMessage message;
  while (log_->next(message)) {
  }
  listing_ = false;
  for (std::vector<Stamp>& stamps : stamps_) std::sort(stamps.begin(), stamps.end());
  if (stamps_[0].empty()) {
    throw InputError(log, 0, "", "has no image of camera 0 in the time of the run",
                     "Give the log that the run was made from with --log");
  }
}

bool LogImages::wants(Stamp stamp, std::uint32_t camera) {
  if (listing_) {
    if (stamp >= first_ && stamp <= last_) stamps_[camera].push_back(stamp);
    return false;
  }
  if (camera != wanted_camera_) return false;
  passed_ = passed_ || stamp > wanted_;
  return stamp == wanted_;
}

ImageView LogImages::at(Stamp stamp, std::size_t camera) {
  if (camera >= cameras() || !std::binary_search(stamps_[camera].begin(), stamps_[camera].end(), stamp)) {
    return {};
  }
  wanted_ = stamp;
  wanted_camera_ = camera;
  passed_ = false;
  log_->seek(stamp);
  try {
    SensorMessage message;
    while (!passed_ && log_->next(message)) {
      if (const auto* frame = std::get_if<CameraFrame>(&message)) return frame->image;
      if (std::get<ImuSample>(message).stamp > stamp + kMostDelay) break;
    }
  } catch (const InputError&) {
    // Damaged since it was listed; the other images can still be shown.
  }
  return {};
}

std::string logOf(const RunFiles& files) {
  if (isRecording(files.folder)) return files.folder;
  constexpr const char* kRemedy = "Name the log with --log to see the images";
  std::string log = files.text("run/log");
  if (log.empty()) {
    throw InputError(files.folder, 0, "", "has no recording, and its summary names no log", kRemedy);
  }
  std::error_code error;
  if (!std::filesystem::exists(log, error)) {
    throw InputError(log, 0, "", error ? error.message() : "the run's log is not there any more", kRemedy);
  }
  return log;
}

}  // namespace swiftlet
