#include "drivers/simulated/texture.hpp"

#include <utility>

namespace swiftlet {

Texture::Texture(std::vector<std::uint8_t> texels, int width, int height, float per_metre)
    : texels_(std::move(texels)), per_metre_(per_metre) {
  texels_.reserve(texels_.size() * 4 / 3 + 64);
  std::ptrdiff_t offset = 0;
  for (levels_ = 0; levels_ < kMaxLevels; ++levels_) {
    level_[static_cast<std::size_t>(levels_)] = {
        offset, width, height, per_metre, static_cast<float>(width - 1), static_cast<float>(height - 1)};
    if (width == 1 && height == 1) {
      ++levels_;
      break;
    }
    if (levels_ + 1 == kMaxLevels) {
      ++levels_;
      break;
    }
    // The next level averages 2 x 2 texels; an odd last row or column is averaged with itself.
    const int half_width = (width + 1) / 2;
    const int half_height = (height + 1) / 2;
    const std::ptrdiff_t next = offset + static_cast<std::ptrdiff_t>(width) * height;
    texels_.resize(static_cast<std::size_t>(next + static_cast<std::ptrdiff_t>(half_width) * half_height));
    for (int y = 0; y < half_height; ++y) {
      const std::uint8_t* a = texels_.data() + offset + static_cast<std::ptrdiff_t>(2 * y) * width;
      const std::uint8_t* b = 2 * y + 1 < height ? a + width : a;
      std::uint8_t* out = texels_.data() + next + static_cast<std::ptrdiff_t>(y) * half_width;
      for (int x = 0; x < half_width; ++x) {
        const int left = 2 * x;
        const int right = std::min(left + 1, width - 1);
        out[x] = static_cast<std::uint8_t>((a[left] + a[right] + b[left] + b[right] + 2) / 4);
      }
    }
    offset = next;
    width = half_width;
    height = half_height;
    per_metre *= 0.5F;
  }
}

}  // namespace swiftlet
