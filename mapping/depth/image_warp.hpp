#pragma once
// Warps images of a raw camera to those of an ideal pinhole camera with the same centre: bilinear for grey
// values, nearest pixel for labels.
//
// The map is computed once: position in whole pixels and 1/128 px, 6 bytes a pixel. Warping uses integers
// only, about 2 ns a pixel. Pixels without a raw pixel (outside the raw image, or where the model has no
// inverse) are 0. Errors: kInvalidInput (image missing, or not of the camera's size); the output is then
// unchanged.

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "estimator/camera/camera_model.hpp"
#include "estimator/core/image_view.hpp"
#include "estimator/core/status.hpp"
#include "estimator/messages/depth_image.hpp"

namespace swiftlet {

class ImageWarp {
 public:
  /// Largest side of a raw image [px], because maps hold positions in 16 bits.
  static constexpr int kMaxSide = 16384;

  /// An empty map, which refuses every image.
  ImageWarp() = default;
  /// `R_cam_target`: rotation from ideal camera to raw camera.
  ImageWarp(const CameraModel& camera, const Eigen::Matrix3d& R_cam_target, const PinholeIntrinsics& target);

  /// `out`: pixels of the target, without padding.
  Status warp(const ImageView& raw, std::uint8_t* out) const;
  Status warpLabels(const ImageView& raw, std::uint8_t* out) const;

  [[nodiscard]] std::size_t pixels() const { return map_.size(); }
  /// False if the target's pixel has no raw pixel.
  [[nodiscard]] bool covered(std::size_t pixel) const { return map_[pixel].x >= 0; }

 private:
  /// Top left of the four raw pixels, and the position between them.
  struct Source {
    std::int16_t x = -1;  ///< negative: none
    std::int16_t y = -1;
    std::uint8_t right = 0;  ///< 1/128 px
    std::uint8_t down = 0;
  };

  [[nodiscard]] Status check(const ImageView& raw) const;

  int width_ = 0;  ///< of raw images
  int height_ = 0;
  std::vector<Source> map_;
};

}  // namespace swiftlet
