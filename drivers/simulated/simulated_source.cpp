#include "drivers/simulated/simulated_source.hpp"

namespace swiftlet {

SimulatedSource::SimulatedSource(const SimulationSettings& settings) : flight_(settings), cameras_(flight_) {
  for (std::size_t c = 0; c < cameras_.cameraCount(); ++c) {
    const CameraModel& camera = flight_.trueRig().camera[c];
    const auto bytes = static_cast<std::size_t>(camera.width()) * static_cast<std::size_t>(camera.height());
    buffers_[c].assign(kBuffersPerCamera, std::vector<std::uint8_t>(bytes));
  }
}

void SimulatedSource::renderNext() {
  std::array<std::uint8_t*, kMaxCameras> grey{};
  for (std::size_t c = 0; c < cameras_.cameraCount(); ++c) {
    grey[c] = buffers_[c][sequence_[c] % kBuffersPerCamera].data();
  }
  std::array<bool, kMaxCameras> present{};
  cameras_.render(next_image_, grey, present);
  for (std::size_t c = 0; c < cameras_.cameraCount(); ++c) {
    if (!present[c]) continue;
    const CameraModel& camera = flight_.trueRig().camera[c];
    CameraFrame& frame = waiting_[c];
    frame.stamp = flight_.imageStamp(next_image_);
    frame.arrival = frame.stamp + Duration::fromSeconds(0.5 * flight_.settings().render.exposure);
    frame.clock = Clock::kLog;
    frame.camera = static_cast<std::uint32_t>(c);
    frame.sequence = sequence_[c]++;
    frame.image = {grey[c], camera.width(), camera.height(), camera.width()};
    is_waiting_[c] = true;
  }
  ++next_image_;
}

SimulatedSource::Item SimulatedSource::next(ImuSample& sample, CameraFrame& frame) {
  const auto& samples = flight_.imu().samples;
  for (;;) {
    std::size_t camera = 0;
    while (camera < kMaxCameras && !is_waiting_[camera]) ++camera;
    const bool has_frame = camera < kMaxCameras;
    const bool more_images = next_image_ < flight_.imageCount();
    const Stamp image_stamp = has_frame     ? waiting_[camera].stamp
                              : more_images ? flight_.imageStamp(next_image_)
                                            : Stamp{INT64_MAX};
    if (next_sample_ < samples.size() && samples[next_sample_].stamp <= image_stamp) {
      sample = samples[next_sample_++];
      return Item::kImu;
    }
    if (has_frame) {
      is_waiting_[camera] = false;
      frame = waiting_[camera];
      return Item::kFrame;
    }
    if (!more_images) return Item::kEnd;
    renderNext();
  }
}

}  // namespace swiftlet
