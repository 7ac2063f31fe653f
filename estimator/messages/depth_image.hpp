#pragma once
// A view of a depth image of an ideal pinhole camera, from stereo, a sensor or a log.
//
// Row-major without padding, `camera.width` x `camera.height`. Depth is in metres along the optical axis; 0
// where nothing was measured (also for NaN or negative values of a sensor). Frames: the camera looks along
// +z, x right, y down; body is the IMU. Does not own the data.

#include <cstddef>
#include <cstdint>

#include "estimator/core/stamp.hpp"
#include "estimator/geometry/se3.hpp"

namespace swiftlet {

/// Intrinsics of a camera without distortion: u = fx x / z + cx, v = fy y / z + cy [px].
struct PinholeIntrinsics {
  double fx = 0;
  double fy = 0;
  double cx = 0;
  double cy = 0;
  int width = 0;
  int height = 0;

  [[nodiscard]] std::size_t pixels() const {
    return static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  }
};

struct DepthImageView {
  Stamp stamp;  ///< mid-exposure
  PinholeIntrinsics camera;
  SE3 T_body_camera;
  const float* depth = nullptr;             ///< m; 0: none
  const float* sigma = nullptr;             ///< m, standard deviation; null: the reader uses its own model
  const std::uint8_t* intensity = nullptr;  ///< grey; null: none
  const std::uint8_t* labels = nullptr;     ///< classes, 0 (kNoLabel) if unknown; null: none
};

}  // namespace swiftlet
