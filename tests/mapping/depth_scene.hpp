#pragma once
// A rig, and what its raw cameras see of a textured plane.

#include <Eigen/Geometry>
#include <cmath>
#include <cstdint>
#include <vector>

#include "estimator/camera/rig.hpp"
#include "estimator/core/image_view.hpp"
#include "estimator/geometry/so3.hpp"

namespace swiftlet::depth_scene {

inline constexpr int kWidth = 320;
inline constexpr int kHeight = 240;

/// Cameras a little turned against each other, with distortion.
inline Rig makeRig(CameraKind kind) {
  Rig rig;
  rig.camera_count = 2;
  const bool radtan = kind == CameraKind::kPinholeRadtan;
  const Eigen::Vector4d d =
      radtan ? Eigen::Vector4d(-0.28, 0.07, 2e-4, -1e-4) : Eigen::Vector4d(-0.01, 0.02, -0.01, 0.001);
  const double f = radtan ? 200 : 140;
  rig.camera[0] = CameraModel(kind, kWidth, kHeight, {f, f - 1, 157, 124}, d);
  rig.camera[1] = CameraModel(kind, kWidth, kHeight, {f - 0.5, f + 0.5, 163, 118}, 1.02 * d);
  Eigen::Matrix3d R;
  R << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  rig.T_body_cam[0] = SE3(R, Eigen::Vector3d(0.1, 0.05, 0.02));
  rig.T_body_cam[1] =
      SE3(R * expSo3(Eigen::Vector3d(0.012, -0.02, 0.015)), Eigen::Vector3d(0.098, -0.06, 0.021));
  return rig;
}

struct Image {
  std::vector<std::uint8_t> pixels = std::vector<std::uint8_t>(std::size_t{kWidth} * kHeight, 0);
  [[nodiscard]] ImageView view() const { return {pixels.data(), kWidth, kHeight, kWidth}; }
};

/// Random values 0 .. 1 at whole places, bilinear between them.
inline double valueNoise(double a, double b) {
  const auto at = [](std::int64_t i, std::int64_t j) {
    std::uint64_t h = static_cast<std::uint64_t>(i) * 0x9E3779B97F4A7C15U ^
                      static_cast<std::uint64_t>(j) * 0xC2B2AE3D27D4EB4FU;
    h = (h ^ (h >> 29U)) * 0xBF58476D1CE4E5B9U;
    return static_cast<double>((h ^ (h >> 32U)) >> 11U) / 9007199254740992.0;
  };
  const double i = std::floor(a), j = std::floor(b);
  const double u = a - i, v = b - j;
  const auto x = static_cast<std::int64_t>(i), y = static_cast<std::int64_t>(j);
  return (1 - v) * ((1 - u) * at(x, y) + u * at(x + 1, y)) +
         v * ((1 - u) * at(x, y + 1) + u * at(x + 1, y + 1));
}

/// Grey of a surface at (a, b) [m]: patches of 3 cm on patches of 12 cm.
inline double textureAt(double a, double b) {
  return 20 + 140 * valueNoise(a / 0.03, b / 0.03) + 75 * valueNoise(a / 0.12, b / 0.12);
}

/// Plane n . p = offset in body coordinates (n a unit vector), seen by the raw camera.
inline Image seePlane(const Rig& rig, std::size_t camera, const Eigen::Vector3d& n, double offset) {
  Image image;
  const Eigen::Vector3d u = n.unitOrthogonal();
  const Eigen::Vector3d v = n.cross(u);
  const SE3& T = rig.T_body_cam[camera];
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      Eigen::Vector3d bearing;
      if (!rig.camera[camera].unproject(Eigen::Vector2d(x, y), bearing)) continue;
      const Eigen::Vector3d ray = T.rotation * bearing;
      const double range = (offset - n.dot(T.translation)) / n.dot(ray);
      const Eigen::Vector3d p = T.translation + range * ray;
      image.pixels[static_cast<std::size_t>(y * kWidth + x)] =
          static_cast<std::uint8_t>(std::lround(textureAt(u.dot(p), v.dot(p))));
    }
  }
  return image;
}

}  // namespace swiftlet::depth_scene
