#include "firmware_host/lab/modules/image_folder.hpp"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "drivers/input/input_error.hpp"

namespace swiftlet {
namespace {

namespace fs = std::filesystem;

// Larger images are refused before memory is allocated.
constexpr int kMaxSide = 16384;  // px

}  // namespace

std::vector<std::string> imagesUnder(const std::string& folder) {
  std::vector<std::string> all;
  std::error_code error;
  for (fs::recursive_directory_iterator at(folder, error), end; !error && at != end; at.increment(error)) {
    const std::string ending = at->path().extension().string();
    if (ending == ".png" || ending == ".jpg" || ending == ".jpeg") all.push_back(at->path().string());
  }
  if (error) {
    throw InputError(folder, 0, "", "cannot be read (" + error.message() + ")", "Give a folder of images");
  }
  if (all.empty()) throw InputError(folder, 0, "", "no .png or .jpg in it", "Give a folder of images");
  std::sort(all.begin(), all.end());
  return all;
}

bool ImageFile::read(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  bytes_.assign(std::istreambuf_iterator<char>(in), {});
  ImageSize found;
  DecodeResult result = decoder_.decode(bytes_, size_, pixels_.data(), found);
  if (result == DecodeResult::kWrongSize && found.width > 0 && found.height > 0 && found.width <= kMaxSide &&
      found.height <= kMaxSide) {
    size_ = found;
    pixels_.resize(static_cast<std::size_t>(size_.width) * static_cast<std::size_t>(size_.height));
    result = decoder_.decode(bytes_, size_, pixels_.data(), found);
  }
  return result == DecodeResult::kOk;
}

}  // namespace swiftlet
