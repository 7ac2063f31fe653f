#include "drivers/recorded/depth_images.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace swiftlet {

DepthImages::DepthImages(const std::string& log, LogWarnings& warnings, const SE3& T_body_filebody)
    : files_(findAslFiles(log)), warnings_(warnings) {
  if (files_.tree == nullptr || !files_.tree->isFile(files_.at("depth0/data.csv"))) return;
  std::vector<std::string> remarks;
  const std::string sensor = files_.at("depth0/sensor.yaml");
  sensor_ = readDepthSensor({files_.tree->name(sensor), files_.tree->text(sensor)}, remarks);
  for (const std::string& remark : remarks) warnings_.add(remark);
  sensor_.T_body_camera = T_body_filebody * sensor_.T_body_camera;
  const std::string list = files_.at("depth0/data.csv");
  rows_ = readImageListText(files_.tree->name(list), files_.tree->text(list), counters_, warnings_);
  units_.resize(sensor_.camera.pixels());
  depth_.resize(sensor_.camera.pixels());
}

DepthImageView DepthImages::at(Stamp stamp) {
  DepthImageView view;
  view.stamp = stamp;
  view.camera = sensor_.camera;
  view.T_body_camera = sensor_.T_body_camera;
  const auto row = std::ranges::lower_bound(rows_, stamp, {}, &ImageRow::stamp);
  if (row == rows_.end() || row->stamp != stamp) return view;
  const std::string name = row->file.empty() ? std::to_string(stamp.ns) + ".png" : row->file;
  const std::string path = files_.at("depth0/data/" + name);
  if (!files_.tree->read(path, bytes_)) {
    warnings_.addCounted(++counters_.missing_images, files_.tree->name(path) + ": missing, depth skipped");
    return view;
  }
  const ImageSize size{view.camera.width, view.camera.height};
  ImageSize found;
  const DecodeResult result = decoder_.decode16(bytes_, size, units_.data(), found);
  if (result != DecodeResult::kOk) {
    const std::string what = result == DecodeResult::kWrongSize
                                 ? fmt::format("{}x{} pixels, but sensor.yaml specifies {}x{}", found.width,
                                               found.height, size.width, size.height)
                                 : "damaged or not a 16-bit grey PNG";
    warnings_.addCounted(++counters_.damaged_images,
                         files_.tree->name(path) + ": " + what + ", depth skipped");
    return view;
  }
  const auto scale = static_cast<float>(sensor_.metres_per_unit);
  std::ranges::transform(units_, depth_.begin(),
                         [scale](std::uint16_t u) { return static_cast<float>(u) * scale; });
  ++counters_.images[0];
  view.depth = depth_.data();
  return view;
}

}  // namespace swiftlet
