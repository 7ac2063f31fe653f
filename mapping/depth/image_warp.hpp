#pragma once
// A raw camera's images as an ideal pinhole camera at the same place sees them: bilinear for grey, the
// nearest pixel for labels.
//
// The map is computed once: position in whole pixels and 1/128 px, 6 bytes a pixel; at run time integers
// only, about 2 ns a pixel. Pixels without a raw one (outside the raw image, or where the model has no
// inverse) are 0. Errors: kInvalidInput (image missing, or not of the camera's size); the output is untouched
// then.

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
  /// Raw images have at most so many pixels a side: maps hold positions in 16 bits.
  static constexpr int kMaxSide = 16384;

  /// Maps nothing: every image is refused.
  ImageWarp() = default;
  /// `R_cam_target`: ideal camera to raw camera.
  ImageWarp(const CameraModel& camera, const Eigen::Matrix3d& R_cam_target, const PinholeIntrinsics& target);

  /// `out`: the target's pixels, rows packed.
  Status warp(const ImageView& raw, std::uint8_t* out) const;
  Status warpLabels(const ImageView& raw, std::uint8_t* out) const;

  [[nodiscard]] std::size_t pixels() const { return map_.size(); }
  /// False where the target's pixel has no raw one.
  [[nodiscard]] bool covered(std::size_t pixel) const { return map_[pixel].x >= 0; }

 private:
  /// Top left of the four raw pixels, and the place between them.
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
