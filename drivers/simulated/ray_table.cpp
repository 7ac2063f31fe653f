#include "drivers/simulated/ray_table.hpp"

#include <limits>

namespace swiftlet {

RayTable::RayTable(const CameraModel& camera)
    : width_(camera.width()),
      height_(camera.height()),
      pixel_angle_(static_cast<float>(1.0 / camera.focal())) {
  const auto count = static_cast<std::size_t>(width_ + 1) * static_cast<std::size_t>(height_ + 1);
  x_.reserve(count);
  y_.reserve(count);
  z_.reserve(count);
  for (int row = 0; row <= height_; ++row) {
    for (int column = 0; column <= width_; ++column) {
      Eigen::Vector3d ray;
      if (!camera.unproject(Eigen::Vector2d(column, row), ray)) {
        ray.setConstant(std::numeric_limits<double>::quiet_NaN());
      }
      x_.push_back(static_cast<float>(ray.x()));
      y_.push_back(static_cast<float>(ray.y()));
      z_.push_back(static_cast<float>(ray.z()));
    }
  }
}

}  // namespace swiftlet
