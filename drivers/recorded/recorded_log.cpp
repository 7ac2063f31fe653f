#include "drivers/recorded/recorded_log.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "drivers/recorded/imu_file.hpp"

namespace swiftlet {
namespace {

constexpr double kRateTolerance = 0.1;

}  // namespace

void RecordedLog::checkRates(const std::string& name) {
  const double measured = medianRate(samples_);
  const double stated = calibration_.noise.rate_hz;
  if (options_.uncalibrated) {
    calibration_.noise.rate_hz = measured;
    return;
  }
  if (measured > 0 && std::abs(measured - stated) > kRateTolerance * stated) {
    warnings_.add(fmt::format(
        "{}: the IMU runs at {:.1f} Hz, its calibration specifies {:g} Hz; the measured rate is used", name,
        measured, stated));
    calibration_.noise.rate_hz = measured;
  }
}

/// Takes the size from the first image of each camera.
void RecordedLog::takeImageSizes() {
  for (std::uint32_t camera = 0; camera < calibration_.rig.camera_count; ++camera) {
    for (const ImageEntry& entry : images_) {
      if (entry.camera != camera) continue;
      const Fetched fetched = fetch(entry, {}, nullptr);
      if (fetched.found.width <= 0 || fetched.found.height <= 0) continue;
      // A placeholder lens of which only the size is used.
      calibration_.rig.camera[camera] =
          CameraModel(CameraKind::kEquidistant, fetched.found.width, fetched.found.height,
                      Eigen::Vector4d(fetched.found.width, fetched.found.width,
                                      0.5 * (fetched.found.width - 1), 0.5 * (fetched.found.height - 1)),
                      Eigen::Vector4d::Zero());
      break;
    }
  }
}

void RecordedLog::prepare(const std::string& name) {
  checkRates(name);
  calibration_.rig.shift_margin = options_.shift_margin;
  for (const std::string& line : calibration_.warnings) warnings_.add(line);
  const ImuCorrection correction = calibration_.imuCorrection();
  if (!correction.isIdentity()) {
    for (ImuSample& sample : samples_) correction.apply(sample);
  }
  std::sort(images_.begin(), images_.end(), [](const ImageEntry& a, const ImageEntry& b) {
    return a.stamp != b.stamp ? a.stamp < b.stamp : a.camera < b.camera;
  });
  if (!images_.empty() && !samples_.empty() &&
      (samples_.back().stamp < images_.front().stamp || samples_.front().stamp > images_.back().stamp)) {
    throw InputError(name, 0, "timestamp",
                     fmt::format("the samples ({} to {}) and the images ({} to {}) do not overlap in time",
                                 samples_.front().stamp.ns, samples_.back().stamp.ns,
                                 images_.front().stamp.ns, images_.back().stamp.ns),
                     "Use stamps of one clock, in nanoseconds");
  }
  for (std::size_t i = 0; i < images_.size(); ++i) {
    if (i == 0 || images_[i].stamp != images_[i - 1].stamp) ++frame_count_;
  }
  if (images_.empty()) return;
  if (options_.uncalibrated) takeImageSizes();
  for (std::size_t camera = 0; camera < calibration_.rig.camera_count; ++camera) {
    const CameraModel& model = calibration_.rig.camera[camera];
    pools_[camera].memory.resize(kImageSlots * static_cast<std::size_t>(model.width()) *
                                 static_cast<std::size_t>(model.height()));
  }
}

bool RecordedLog::imageIsNext() const {
  if (next_image_ == images_.size()) return false;
  return next_sample_ == samples_.size() ||
         samples_[next_sample_].stamp > images_[next_image_].stamp + calibration_.rig.sampleLead();
}

bool RecordedLog::next(SensorMessage& message) {
  while (true) {
    const bool image_left = next_image_ < images_.size();
    if (!image_left && !images_.empty() && !options_.imu_after_last_image) return false;
    if (!image_left && next_sample_ == samples_.size()) return false;
    if (!imageIsNext()) {
      message = samples_[next_sample_++];
      ++counters_.imu_samples;
      return true;
    }
    const ImageEntry& entry = images_[next_image_++];
    if (options_.wants_image && !options_.wants_image(entry.stamp, entry.camera)) continue;
    if (deliverImage(entry, message)) return true;
  }
}

void RecordedLog::seek(Stamp stamp) {
  const auto first = [stamp](const auto& list) {
    const auto found = std::lower_bound(list.begin(), list.end(), stamp,
                                        [](const auto& entry, Stamp wanted) { return entry.stamp < wanted; });
    return static_cast<std::size_t>(found - list.begin());
  };
  next_sample_ = first(samples_);
  next_image_ = first(images_);
}

bool RecordedLog::deliverImage(const ImageEntry& entry, SensorMessage& message) {
  const CameraModel& model = calibration_.rig.camera[entry.camera];
  const ImageSize expected{model.width(), model.height()};
  const std::size_t bytes =
      static_cast<std::size_t>(expected.width) * static_cast<std::size_t>(expected.height);
  Pool& pool = pools_[entry.camera];
  std::uint8_t* out = pool.memory.data() + pool.slot * bytes;
  const Fetched fetched = fetch(entry, expected, out);
  if (fetched.missing) {
    warnings_.addCounted(++counters_.missing_images, fetched.name + ": missing, image skipped");
    return false;
  }
  if (fetched.result == DecodeResult::kWrongSize && counters_.images[entry.camera] == 0) {
    throw InputError(
        fetched.name, 0, "",
        fmt::format("the image has {}x{} pixels, but the calibration of cam{} is for {}x{}",
                    fetched.found.width, fetched.found.height, entry.camera, expected.width, expected.height),
        "Give the calibration of this image size");
  }
  if (fetched.result != DecodeResult::kOk) {
    const char* what = fetched.result == DecodeResult::kUnknownFormat ? "neither PNG nor JPEG"
                       : fetched.result == DecodeResult::kWrongSize   ? "not the size of the previous images"
                                                                      : "damaged or truncated";
    warnings_.addCounted(++counters_.damaged_images, fetched.name + ": " + what + ", image skipped");
    return false;
  }
  pool.slot = (pool.slot + 1) % kImageSlots;
  ++counters_.images[entry.camera];
  CameraFrame frame;
  frame.stamp = entry.stamp;
  frame.arrival = entry.stamp;
  frame.clock = Clock::kLog;
  frame.camera = entry.camera;
  frame.sequence = entry.index;
  frame.image = {out, expected.width, expected.height, expected.width};
  message = frame;
  return true;
}

}  // namespace swiftlet
