#include "mapping/map/view_warp.hpp"

#include <cmath>

namespace swiftlet {
namespace {

// Centres nearer than this count as one [m]: at half a metre the shift is below a pixel.
constexpr double kOneCentre = 0.001;

Eigen::Vector3d rayOf(const PinholeIntrinsics& camera, int x, int y) {
  return {(x - camera.cx) / camera.fx, (y - camera.cy) / camera.fy, 1};
}

}  // namespace

ViewWarp::ViewWarp(const PinholeIntrinsics& depth_camera, const CameraModel& other, const SE3& T_other_depth)
    : camera_(depth_camera),
      other_(other),
      T_other_depth_(T_other_depth),
      together_(T_other_depth.translation.norm() < kOneCentre) {
  if (!together_) return;
  table_.reserve(camera_.pixels());
  for (int y = 0; y < camera_.height; ++y) {
    for (int x = 0; x < camera_.width; ++x) table_.push_back(pixelOf(rayOf(camera_, x, y)));
  }
}

std::int32_t ViewWarp::pixelOf(const Eigen::Vector3d& p_depth) const {
  Eigen::Vector2d pixel;
  if (!other_.project(T_other_depth_ * p_depth, pixel)) return kNowhere;
  constexpr double kHalfPixel = 0.5;
  if (!(pixel.x() > -kHalfPixel && pixel.x() < other_.width() - kHalfPixel && pixel.y() > -kHalfPixel &&
        pixel.y() < other_.height() - kHalfPixel)) {
    return kNowhere;
  }
  const auto x = static_cast<std::int32_t>(std::lround(pixel.x()));
  const auto y = static_cast<std::int32_t>(std::lround(pixel.y()));
  return y * other_.width() + x;
}

Status ViewWarp::apply(const ImageView& image, const float* depth, std::uint8_t* out) const {
  if (image.empty() || image.width != other_.width() || image.height != other_.height()) {
    return {StatusCode::kInvalidInput, "the image does not have its camera's size"};
  }
  std::size_t i = 0;
  for (int y = 0; y < camera_.height; ++y) {
    for (int x = 0; x < camera_.width; ++x, ++i) {
      std::int32_t at = kNowhere;
      if (together_) {
        at = table_[i];
      } else if (depth[i] > 0) {
        at = pixelOf(static_cast<double>(depth[i]) * rayOf(camera_, x, y));
      }
      out[i] = at == kNowhere ? std::uint8_t{0} : image.row(at / other_.width())[at % other_.width()];
    }
  }
  return okStatus();
}

}  // namespace swiftlet
