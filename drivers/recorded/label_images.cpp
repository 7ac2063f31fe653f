#include "drivers/recorded/label_images.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace swiftlet {

LabelImages::LabelImages(const std::string& log, ImageSize size, LogWarnings& warnings)
    : files_(findAslFiles(log)), size_(size), warnings_(warnings) {
  if (files_.tree == nullptr || !files_.tree->isFile(files_.at("labels0/data.csv"))) return;
  const std::string list = files_.at("labels0/data.csv");
  rows_ = readImageListText(files_.tree->name(list), files_.tree->text(list), counters_, warnings_);
  pixels_.resize(static_cast<std::size_t>(size.width) * static_cast<std::size_t>(size.height));
}

ImageView LabelImages::at(Stamp stamp) {
  const auto row = std::ranges::lower_bound(rows_, stamp, {}, &ImageRow::stamp);
  if (row == rows_.end() || row->stamp != stamp) return {};
  const std::string name = row->file.empty() ? std::to_string(stamp.ns) + ".png" : row->file;
  const std::string path = files_.at("labels0/data/" + name);
  if (!files_.tree->read(path, bytes_)) {
    warnings_.addCounted(++counters_.missing_images, files_.tree->name(path) + ": missing, labels skipped");
    return {};
  }
  ImageSize found;
  const DecodeResult result = decoder_.decode(bytes_, size_, pixels_.data(), found);
  if (result != DecodeResult::kOk) {
    const std::string what = result == DecodeResult::kWrongSize
                                 ? fmt::format("{}x{} pixels, but camera 0 has {}x{}", found.width,
                                               found.height, size_.width, size_.height)
                                 : "damaged or not a PNG";
    warnings_.addCounted(++counters_.damaged_images,
                         files_.tree->name(path) + ": " + what + ", labels skipped");
    return {};
  }
  ++counters_.images[0];
  return {pixels_.data(), size_.width, size_.height, size_.width};
}

}  // namespace swiftlet
