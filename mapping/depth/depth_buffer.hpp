#pragma once
// A depth image that owns its memory; DepthImageView refers to it. Sized once; a stage fills it in place.

#include <cstdint>
#include <vector>

#include "estimator/messages/depth_image.hpp"

namespace swiftlet {

struct DepthBuffer {
  DepthBuffer() = default;
  /// 10 bytes a pixel.
  explicit DepthBuffer(const PinholeIntrinsics& intrinsics)
      : camera(intrinsics),
        depth(intrinsics.pixels(), 0.0F),
        sigma(intrinsics.pixels(), 0.0F),
        intensity(intrinsics.pixels(), 0),
        labels(intrinsics.pixels(), 0) {}

  Stamp stamp;
  PinholeIntrinsics camera;
  SE3 T_body_camera;
  std::vector<float> depth;  ///< m; 0: none
  std::vector<float> sigma;  ///< m; only valid where there is a depth
  std::vector<std::uint8_t> intensity;
  std::vector<std::uint8_t> labels;
  bool has_intensity = false;
  bool has_labels = false;

  [[nodiscard]] DepthImageView view() const {
    return {stamp,
            camera,
            T_body_camera,
            depth.data(),
            sigma.data(),
            has_intensity ? intensity.data() : nullptr,
            has_labels ? labels.data() : nullptr};
  }
};

}  // namespace swiftlet
