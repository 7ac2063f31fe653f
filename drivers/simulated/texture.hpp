#pragma once
// A grey texture with its pyramid of halved copies (mip map; Williams, SIGGRAPH 1983).

#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

namespace swiftlet {

class Texture {
 public:
  static constexpr int kMaxLevels = 12;

  Texture() = default;
  /// `texels`: row-major, width x height, one every 1 / `per_metre` metres.
  Texture(std::vector<std::uint8_t> texels, int width, int height, float per_metre);

  [[nodiscard]] float perMetre() const { return per_metre_; }
  [[nodiscard]] std::size_t bytes() const { return texels_.size(); }
  [[nodiscard]] int levels() const { return levels_; }

  /// Value at (u, v) metres in the given level, bilinear, constant beyond the edges; 0 to 255.
  [[nodiscard]] float sample(float u, float v, int level) const {
    const auto l = static_cast<std::size_t>(std::clamp(level, 0, levels_ - 1));
    const Level& info = level_[l];
    const float x = std::clamp(u * info.per_metre - 0.5F, 0.0F, info.last_x);
    const float y = std::clamp(v * info.per_metre - 0.5F, 0.0F, info.last_y);
    const int x0 = static_cast<int>(x);
    const int y0 = static_cast<int>(y);
    const float fx = x - static_cast<float>(x0);
    const float fy = y - static_cast<float>(y0);
    const std::uint8_t* p = texels_.data() + info.offset + y0 * info.width + x0;
    const int right = x0 + 1 < info.width ? 1 : 0;
    const int below = y0 + 1 < info.height ? info.width : 0;
    const float top = static_cast<float>(p[0]) + fx * static_cast<float>(p[right] - p[0]);
    const float low = static_cast<float>(p[below]) + fx * static_cast<float>(p[below + right] - p[below]);
    return top + fy * (low - top);
  }

 private:
  struct Level {
    std::ptrdiff_t offset = 0;
    int width = 0;
    int height = 0;
    float per_metre = 0;
    float last_x = 0;
    float last_y = 0;
  };
  std::vector<std::uint8_t> texels_;
  std::array<Level, kMaxLevels> level_{};
  int levels_ = 0;
  float per_metre_ = 0;
};

}  // namespace swiftlet
