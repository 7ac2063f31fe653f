#include "drivers/recorded/depth_images.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>

namespace swiftlet {
namespace {

namespace fs = std::filesystem;

fs::path depthFolder(const fs::path& log) {
  return (fs::is_directory(log / "mav0") ? log / "mav0" : log) / "depth0";
}

}  // namespace

DepthImages::DepthImages(const std::string& log, LogWarnings& warnings, const SE3& T_body_filebody)
    : folder_(depthFolder(log)), warnings_(warnings) {
  const fs::path list = fs::path(folder_) / "data.csv";
  if (!fs::exists(list)) return;
  std::vector<std::string> remarks;
  sensor_ = readDepthSensor((fs::path(folder_) / "sensor.yaml").string(), remarks);
  for (const std::string& remark : remarks) warnings_.add(remark);
  sensor_.T_body_camera = T_body_filebody * sensor_.T_body_camera;
  rows_ = readImageList(list.string(), counters_, warnings_);
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
  const fs::path path = fs::path(folder_) / "data" / name;
  std::ifstream file(path, std::ios::binary);
  if (!file) {
    warnings_.addCounted(++counters_.missing_images, path.string() + ": missing, depth skipped");
    return view;
  }
  bytes_.assign(std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>());
  const ImageSize size{view.camera.width, view.camera.height};
  ImageSize found;
  const DecodeResult result = decoder_.decode16(bytes_, size, units_.data(), found);
  if (result != DecodeResult::kOk) {
    const std::string what = result == DecodeResult::kWrongSize
                                 ? fmt::format("{}x{} pixels, sensor.yaml says {}x{}", found.width,
                                               found.height, size.width, size.height)
                                 : "damaged or no PNG of 16 bits grey";
    warnings_.addCounted(++counters_.damaged_images, path.string() + ": " + what + ", depth skipped");
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
