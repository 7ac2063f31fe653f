#include "drivers/recorded/label_images.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>

namespace swiftlet {
namespace {

namespace fs = std::filesystem;

fs::path labelFolder(const fs::path& log) {
  return (fs::is_directory(log / "mav0") ? log / "mav0" : log) / "labels0";
}

}  // namespace

LabelImages::LabelImages(const std::string& log, ImageSize size, LogWarnings& warnings)
    : folder_(labelFolder(log)), size_(size), warnings_(warnings) {
  const fs::path list = fs::path(folder_) / "data.csv";
  if (!fs::exists(list)) return;
  rows_ = readImageList(list.string(), counters_, warnings_);
  pixels_.resize(static_cast<std::size_t>(size.width) * static_cast<std::size_t>(size.height));
}

ImageView LabelImages::at(Stamp stamp) {
  const auto row = std::ranges::lower_bound(rows_, stamp, {}, &ImageRow::stamp);
  if (row == rows_.end() || row->stamp != stamp) return {};
  const std::string name = row->file.empty() ? std::to_string(stamp.ns) + ".png" : row->file;
  const fs::path path = fs::path(folder_) / "data" / name;
  std::ifstream file(path, std::ios::binary);
  if (!file) {
    warnings_.addCounted(++counters_.missing_images, path.string() + ": missing, labels skipped");
    return {};
  }
  bytes_.assign(std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>());
  ImageSize found;
  const DecodeResult result = decoder_.decode(bytes_, size_, pixels_.data(), found);
  if (result != DecodeResult::kOk) {
    const std::string what = result == DecodeResult::kWrongSize
                                 ? fmt::format("{}x{} pixels, camera 0 has {}x{}", found.width, found.height,
                                               size_.width, size_.height)
                                 : "damaged or no PNG";
    warnings_.addCounted(++counters_.damaged_images, path.string() + ": " + what + ", labels skipped");
    return {};
  }
  ++counters_.images[0];
  return {pixels_.data(), size_.width, size_.height, size_.width};
}

}  // namespace swiftlet
