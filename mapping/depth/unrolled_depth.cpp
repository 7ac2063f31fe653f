#include "mapping/depth/unrolled_depth.hpp"

#include <cmath>
#include <utility>

#include "estimator/messages/camera_scan.hpp"

namespace swiftlet {
namespace {

// Depth at which a pixel without one is looked for: the turn is most of what moves it.
constexpr double kFar = 100;  // m
constexpr int kRounds = 2;

}  // namespace

UnrolledDepth::UnrolledDepth(const Rig& rig, const PinholeIntrinsics& camera, const SE3& T_body_camera)
    : camera_(camera), T_body_camera_(T_body_camera), row_time_(camera.pixels(), 0.0F), result_(camera) {
  const Eigen::Quaterniond R_cam_depth = rig.T_body_cam[0].rotation.conjugate() * T_body_camera_.rotation;
  for (std::size_t i = 0; i < row_time_.size(); ++i) {
    const auto width = static_cast<std::size_t>(camera_.width);
    Eigen::Vector2d pixel;
    if (!rig.camera[0].project(R_cam_depth * rayAt(i % width, i / width), pixel)) continue;
    row_time_[i] = static_cast<float>(rig.rowTime(0, pixel.y()));
  }
}

Eigen::Vector3d UnrolledDepth::rayAt(std::size_t x, std::size_t y) const {
  return {(static_cast<double>(x) - camera_.cx) / camera_.fx,
          (static_cast<double>(y) - camera_.cy) / camera_.fy, 1};
}

void UnrolledDepth::apply(const ScanMotion& motion, DepthBuffer& depth) {
  const CameraScan scan(T_body_camera_, motion);
  const auto width = static_cast<std::size_t>(camera_.width);
  for (std::size_t i = 0; i < row_time_.size(); ++i) {
    const Eigen::Vector3d ray = rayAt(i % width, i / width);
    std::size_t from = i;
    double z = depth.depth[i] > 0 ? static_cast<double>(depth.depth[i]) : kFar;
    for (int round = 0; round < kRounds && z > 0; ++round) {
      const Eigen::Vector3d p = scan.atRow(z * ray, static_cast<double>(row_time_[from]));
      const double x = std::round(camera_.fx * p.x() / p.z() + camera_.cx);
      const double y = std::round(camera_.fy * p.y() / p.z() + camera_.cy);
      z = 0;
      if (!(p.z() > 0 && x >= 0 && y >= 0 && x < camera_.width && y < camera_.height)) break;
      from = static_cast<std::size_t>(y) * width + static_cast<std::size_t>(x);
      const auto measured = static_cast<double>(depth.depth[from]);
      if (measured > 0) {
        z = scan.fromRow(measured * rayAt(from % width, from / width), static_cast<double>(row_time_[from]))
                .z();
      }
    }
    result_.depth[i] = z > 0 ? static_cast<float>(z) : 0.0F;
    result_.sigma[i] = depth.sigma[from];
    result_.intensity[i] = depth.intensity[from];
    result_.labels[i] = depth.labels[from];
  }
  std::swap(depth.depth, result_.depth);
  std::swap(depth.sigma, result_.sigma);
  std::swap(depth.intensity, result_.intensity);
  std::swap(depth.labels, result_.labels);
}

}  // namespace swiftlet
