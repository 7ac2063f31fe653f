#pragma once
// Viewing rays of every pixel of a lens, unprojected once.
//
// Rays are unit vectors in the camera frame at integer pixels (x, y), x in [0, width], y in [0, height]: one
// more than the image in each direction, so that a ray inside a pixel can be interpolated from its neighbours
// (to better than 1e-3 px). Where the lens has no inverse the ray is NaN: it hits nothing and the pixel stays
// dark. Memory: 12 bytes per pixel.

#include <Eigen/Core>
#include <vector>

#include "estimator/camera/camera_model.hpp"

namespace swiftlet {

class RayTable {
 public:
  explicit RayTable(const CameraModel& camera);

  [[nodiscard]] int width() const { return width_; }
  [[nodiscard]] int height() const { return height_; }
  /// Rows of one component: width() + 1 values each.
  [[nodiscard]] const float* x(int row) const { return x_.data() + offset(row); }
  [[nodiscard]] const float* y(int row) const { return y_.data() + offset(row); }
  [[nodiscard]] const float* z(int row) const { return z_.data() + offset(row); }
  [[nodiscard]] Eigen::Vector3f ray(int column, int row) const {
    return {x(row)[column], y(row)[column], z(row)[column]};
  }
  /// Angle between neighbouring rays at the image's centre [rad].
  [[nodiscard]] float pixelAngle() const { return pixel_angle_; }

 private:
  [[nodiscard]] std::ptrdiff_t offset(int row) const {
    return static_cast<std::ptrdiff_t>(row) * (width_ + 1);
  }
  int width_ = 0;
  int height_ = 0;
  float pixel_angle_ = 0;
  std::vector<float> x_;
  std::vector<float> y_;
  std::vector<float> z_;
};

}  // namespace swiftlet
