#include "mapping/depth/image_warp.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace swiftlet {
namespace {

constexpr int kFractionBits = 7;
constexpr int kOne = 1 << kFractionBits;

/// Whole pixel, at most the last but one, and position [1 / kOne px].
std::pair<int, int> fixedPoint(double p, int size) {
  const int position = static_cast<int>(std::lround(std::clamp(p, 0.0, size - 1.0) * kOne));
  return {std::min(position >> kFractionBits, size - 2), position};
}

}  // namespace

ImageWarp::ImageWarp(const CameraModel& camera, const Eigen::Matrix3d& R_cam_target,
                     const PinholeIntrinsics& target) {
  if (camera.width() < 2 || camera.height() < 2 || camera.width() > kMaxSide || camera.height() > kMaxSide)
    return;
  width_ = camera.width();
  height_ = camera.height();
  map_.resize(target.pixels());
  std::size_t i = 0;
  for (int y = 0; y < target.height; ++y) {
    for (int x = 0; x < target.width; ++x, ++i) {
      const Eigen::Vector3d ray((x - target.cx) / target.fx, (y - target.cy) / target.fy, 1);
      Eigen::Vector2d pixel;
      // A pixel reaches half a pixel beyond its centre.
      if (!camera.project(R_cam_target * ray, pixel) || !camera.inImage(pixel, -0.5)) continue;
      const auto [left, u] = fixedPoint(pixel.x(), width_);
      const auto [top, v] = fixedPoint(pixel.y(), height_);
      map_[i] = {static_cast<std::int16_t>(left), static_cast<std::int16_t>(top),
                 static_cast<std::uint8_t>(u - left * kOne), static_cast<std::uint8_t>(v - top * kOne)};
    }
  }
}

Status ImageWarp::check(const ImageView& raw) const {
  if (raw.empty()) return {StatusCode::kInvalidInput, "depth: an image is missing"};
  if (raw.width != width_ || raw.height != height_ || raw.stride < raw.width)
    return {StatusCode::kInvalidInput, "depth: an image does not have the camera's size"};
  return okStatus();
}

Status ImageWarp::warp(const ImageView& raw, std::uint8_t* out) const {
  if (const Status status = check(raw); !status.ok()) return status;
  constexpr int kHalf = 1 << (2 * kFractionBits - 1);
  for (const Source& s : map_) {
    const std::uint8_t* const p = raw.row(std::max<int>(s.y, 0)) + std::max<int>(s.x, 0);
    const std::uint8_t* const q = p + raw.stride;
    const int top = p[0] * (kOne - s.right) + p[1] * s.right;
    const int bottom = q[0] * (kOne - s.right) + q[1] * s.right;
    const int value = (top * (kOne - s.down) + bottom * s.down + kHalf) >> (2 * kFractionBits);
    *out++ = static_cast<std::uint8_t>(s.x >= 0 ? value : 0);
  }
  return okStatus();
}

Status ImageWarp::warpLabels(const ImageView& raw, std::uint8_t* out) const {
  if (const Status status = check(raw); !status.ok()) return status;
  for (const Source& s : map_) {
    const int x = std::max<int>(s.x, 0) + (s.right >= kOne / 2 ? 1 : 0);
    const int y = std::max<int>(s.y, 0) + (s.down >= kOne / 2 ? 1 : 0);
    *out++ = s.x >= 0 ? raw.row(y)[x] : std::uint8_t{0};
  }
  return okStatus();
}

}  // namespace swiftlet
