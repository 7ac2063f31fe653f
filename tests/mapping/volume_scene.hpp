#pragma once
// Depth images of shapes whose distance is known: a half space behind a plane, and a ball.

#include <cmath>
#include <cstdint>
#include <vector>

#include "estimator/messages/depth_image.hpp"
#include "mapping/volume/volume_integrator.hpp"

namespace swiftlet::testing {

inline constexpr PinholeIntrinsics kSceneCamera{100, 100, 79.5, 59.5, 160, 120};

struct SceneImage {
  PinholeIntrinsics camera = kSceneCamera;
  std::vector<float> depth = std::vector<float>(kSceneCamera.pixels(), 0.0F);
  std::vector<std::uint8_t> labels, grey;
  Stamp stamp{1'000'000'000};

  [[nodiscard]] DepthImageView view() const {
    return {stamp,
            camera,
            SE3{},
            depth.data(),
            nullptr,
            grey.empty() ? nullptr : grey.data(),
            labels.empty() ? nullptr : labels.data()};
  }
};

/// Depth z of every pixel by `hit(origin, direction)`: the ray's parameter, direction with z = 1 in camera
/// axes; 0 or less for none.
template <typename Hit>
SceneImage render(const SE3& T_world_camera, double stamp_s, const Hit& hit) {
  SceneImage image;
  image.stamp = {static_cast<std::int64_t>(std::llround(1e9 * stamp_s))};
  for (int v = 0; v < image.camera.height; ++v) {
    for (int u = 0; u < image.camera.width; ++u) {
      const Eigen::Vector3d ray((u - image.camera.cx) / image.camera.fx,
                                (v - image.camera.cy) / image.camera.fy, 1);
      const double t = hit(T_world_camera.translation, Eigen::Vector3d(T_world_camera.rotation * ray));
      image.depth[static_cast<std::size_t>(v * image.camera.width + u)] =
          t > 0 ? static_cast<float>(t) : 0.0F;
    }
  }
  return image;
}

/// The plane n p = d, n towards the free side.
struct Plane {
  Eigen::Vector3d n;
  double d = 0;
  double operator()(const Eigen::Vector3d& origin, const Eigen::Vector3d& ray) const {
    const double slope = n.dot(ray);
    return slope < -1e-9 ? (d - n.dot(origin)) / slope : 0;
  }
};

struct Ball {
  Eigen::Vector3d centre;
  double radius = 0;
  double operator()(const Eigen::Vector3d& origin, const Eigen::Vector3d& ray) const {
    const Eigen::Vector3d to = origin - centre;
    const double a = ray.squaredNorm(), b = to.dot(ray), c = to.squaredNorm() - radius * radius;
    const double root = b * b - a * c;
    return root >= 0 ? (-b - std::sqrt(root)) / a : 0;
  }
};
/// Its centre is no corner of a voxel.
inline const Ball kOffGridBall{{0.03, -0.02, 0.01}, 1.0};

/// A camera at `from` that looks at `to`.
inline SE3 lookAt(const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  const Eigen::Vector3d z = (to - from).normalized();
  const Eigen::Vector3d up = std::abs(z.z()) < 0.9 ? Eigen::Vector3d::UnitZ() : Eigen::Vector3d::UnitX();
  Eigen::Matrix3d R;
  R.col(2) = z;
  R.col(0) = -up.cross(z).normalized();
  R.col(1) = z.cross(Eigen::Vector3d(R.col(0)));
  return {R, from};
}

/// Views of a ball from all around, a second apart.
inline std::vector<SE3> viewsAround(const Ball& ball, double distance) {
  std::vector<SE3> views;
  for (int i = 0; i < 26; ++i) {
    const double height = 1 - (2 * i + 1) / 26.0;
    const double angle = 2.399963 * i;  // the golden angle
    const double r = std::sqrt(1 - height * height);
    views.push_back(
        lookAt(ball.centre + distance * Eigen::Vector3d(r * std::cos(angle), r * std::sin(angle), height),
               ball.centre));
  }
  return views;
}

inline VolumeSettings sceneSettings() {
  VolumeSettings settings;
  settings.memory_bytes = std::size_t{8} << 20U;
  return settings;
}

}  // namespace swiftlet::testing
