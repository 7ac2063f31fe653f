#pragma once
// Disparities of a rectified pair for the pixels of the left image, x_right = x_left - disparity, with
// standard deviations. Fixed point.

#include <cstddef>
#include <cstdint>
#include <vector>

namespace swiftlet {

/// Steps per pixel of disparities and their standard deviations.
inline constexpr int kDisparitySteps = 64;
inline constexpr std::uint16_t kNoDisparity = 0xFFFF;

class DisparityImage {
 public:
  DisparityImage() = default;
  /// Memory: 3 bytes a pixel. All disparities are unknown.
  DisparityImage(int width, int height)
      : width_(width),
        height_(height),
        disparity_(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), kNoDisparity),
        sigma_(disparity_.size(), 0) {}

  [[nodiscard]] int width() const { return width_; }
  [[nodiscard]] int height() const { return height_; }
  [[nodiscard]] std::size_t pixels() const { return disparity_.size(); }
  /// Row-major, no padding. 1/kDisparitySteps px; kNoDisparity where unknown.
  [[nodiscard]] std::uint16_t* disparity() { return disparity_.data(); }
  [[nodiscard]] const std::uint16_t* disparity() const { return disparity_.data(); }
  /// 1/kDisparitySteps px; meaningless where there is no disparity.
  [[nodiscard]] std::uint8_t* sigma() { return sigma_.data(); }
  [[nodiscard]] const std::uint8_t* sigma() const { return sigma_.data(); }

 private:
  int width_ = 0;
  int height_ = 0;
  std::vector<std::uint16_t> disparity_;
  std::vector<std::uint8_t> sigma_;
};

}  // namespace swiftlet
