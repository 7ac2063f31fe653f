#pragma once
// Folders that contain only images, of any size.
//
// Host side: allocates, throws InputError.

#include <cstdint>
#include <string>
#include <vector>

#include "drivers/image/image_decoder.hpp"
#include "estimator/core/image_view.hpp"

namespace swiftlet {

/// All .png, .jpg and .jpeg files under the folder, ordered by name. InputError if the folder cannot be read
/// or has none.
std::vector<std::string> imagesUnder(const std::string& folder);

/// One image of any size, decoded to 8-bit grey. Its memory is reused for the next.
class ImageFile {
 public:
  /// False if it cannot be decoded.
  bool read(const std::string& path);
  /// Valid until the next read().
  [[nodiscard]] ImageView view() const { return {pixels_.data(), size_.width, size_.height, size_.width}; }

 private:
  ImageDecoder decoder_;
  std::vector<std::uint8_t> bytes_;
  std::vector<std::uint8_t> pixels_ = std::vector<std::uint8_t>(1);
  ImageSize size_{1, 1};
};

}  // namespace swiftlet
