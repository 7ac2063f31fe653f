#include "firmware_host/runs/keeping_sink.hpp"

#include <algorithm>
#include <limits>
#include <utility>

namespace swiftlet {

KeepingSink::KeepingSink(std::size_t most) : CountingSink(most), most_(most) { samples_.reserve(most); }

void KeepingSink::takeImu(const ImuSample& sample, Stamp arrival, const HostTimes& host) {
  CountingSink::takeImu(sample, arrival, host);
  if (samples_.size() < most_) samples_.push_back(sample);
}

void KeepingSink::takeImage(const CameraFrame& image, const HostTimes& host) {
  CountingSink::takeImage(image, host);
  const std::size_t bytes =
      static_cast<std::size_t>(image.image.width) * static_cast<std::size_t>(image.image.height);
  std::size_t& kept_bytes = bytes_.at(image.camera);
  if (image.image.empty() || kept_bytes + bytes > kMostBytes) return;
  kept_bytes += bytes;
  Kept kept{image, std::vector<std::uint8_t>(bytes)};
  for (int y = 0; y < image.image.height; ++y) {
    std::copy_n(image.image.row(y), image.image.width,
                kept.pixels.begin() + static_cast<std::ptrdiff_t>(y) * image.image.width);
  }
  kept.frame.image.data = kept.pixels.data();
  kept.frame.image.stride = image.image.width;
  images_[image.camera].push_back(std::move(kept));
}

InspectionReport KeepingSink::inspect(const Calibration& calibration) const {
  Inspection inspection(calibration, std::numeric_limits<std::size_t>::max());
  std::vector<ImuSample> samples = samples_;
  std::ranges::stable_sort(samples, {}, &ImuSample::stamp);
  std::vector<const CameraFrame*> frames;
  for (const std::vector<Kept>& images : images_) {
    for (const Kept& kept : images) frames.push_back(&kept.frame);
  }
  std::ranges::sort(frames, [](const CameraFrame* a, const CameraFrame* b) {
    return a->stamp != b->stamp ? a->stamp < b->stamp : a->camera < b->camera;
  });
  auto sample = samples.begin();
  for (const CameraFrame* frame : frames) {
    for (; sample != samples.end() && sample->stamp <= frame->stamp; ++sample) inspection.add(*sample);
    if (inspection.wants(frame->stamp, frame->camera)) inspection.add(*frame);
  }
  for (; sample != samples.end(); ++sample) inspection.add(*sample);
  return inspection.report();
}

}  // namespace swiftlet
