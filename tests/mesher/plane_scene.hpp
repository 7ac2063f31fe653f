#pragma once
// Meshes of known surfaces as a window would give them: points with noise along the line of sight.

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>
#include <cstdint>
#include <memory>

#include "estimator/core/random.hpp"
#include "estimator/messages/local_mesh.hpp"
#include "estimator/messages/smoothed_window.hpp"

namespace swiftlet::test {

/// A rectangle: corner + u along + v across, seen from the side of along x across.
struct Sheet {
  Eigen::Vector3d corner = Eigen::Vector3d::Zero();
  Eigen::Vector3d along = Eigen::Vector3d::UnitX();   ///< m, its whole edge
  Eigen::Vector3d across = Eigen::Vector3d::UnitY();  ///< likewise
  int columns = 8;
  int rows = 8;
};

class PlaneScene {
 public:
  explicit PlaneScene(std::uint64_t seed, double depth_sigma = 0.01)
      : mesh(std::make_unique<LocalMesh>()),
        window(std::make_unique<SmoothedWindow>()),
        random(seed, 3),
        depth_sigma_(depth_sigma) {
    begin(Eigen::Vector3d::Zero());
  }

  /// Empties the mesh for the next keyframe.
  void begin(const Eigen::Vector3d& viewer) {
    mesh->vertices.clear();
    mesh->faces.clear();
    ++mesh->frame_index;
    window->landmarks.clear();
    window->poses.clear();
    WindowPose pose;
    pose.keyframe = true;
    pose.T_world_body.translation = viewer;
    static_cast<void>(window->poses.tryPushBack(pose));
    next_id_ = 1;
  }

  /// A vertex and its landmark: off by noise along the ray. Its index.
  std::uint32_t add(const Eigen::Vector3d& p) {
    const Eigen::Vector3d ray = p - window->poses.back().T_world_body.translation;
    const double depth = ray.norm();
    const Eigen::Vector3d noisy = p + depth_sigma_ * random.normal() * ray / depth;
    static_cast<void>(mesh->vertices.tryPushBack({next_id_, noisy.cast<float>(), 128}));
    static_cast<void>(window->landmarks.tryPushBack({next_id_, noisy, depth_sigma_ / (depth * depth), 5}));
    ++next_id_;
    return static_cast<std::uint32_t>(mesh->vertices.size() - 1);
  }

  void addSheet(const Sheet& sheet, const Eigen::Vector3d& lift = Eigen::Vector3d::Zero()) {
    const auto base = static_cast<std::uint32_t>(mesh->vertices.size());
    for (int j = 0; j <= sheet.rows; ++j) {
      for (int i = 0; i <= sheet.columns; ++i) {
        // Not on a lattice: landmarks are where texture is.
        const double u = (i + random.uniform(-0.3, 0.3)) / sheet.columns;
        const double v = (j + random.uniform(-0.3, 0.3)) / sheet.rows;
        add(sheet.corner + u * sheet.along + v * sheet.across + lift);
      }
    }
    const auto stride = static_cast<std::uint32_t>(sheet.columns + 1);
    for (std::uint32_t j = 0; j < static_cast<std::uint32_t>(sheet.rows); ++j) {
      for (std::uint32_t i = 0; i < static_cast<std::uint32_t>(sheet.columns); ++i) {
        const std::uint32_t c = base + j * stride + i;
        addFace({c, c + 1, c + stride + 1});
        addFace({c, c + stride + 1, c + stride});
      }
    }
  }
  void addFace(const std::array<std::uint32_t, 3>& vertex) {
    static_cast<void>(mesh->faces.tryPushBack({vertex, kNoLabel}));
  }

  /// Triangles of points drawn in a box, turned towards the viewer.
  void addCloud(const Eigen::Vector3d& low, const Eigen::Vector3d& high, int faces, double edge) {
    const Eigen::Vector3d viewer = window->poses.back().T_world_body.translation;
    for (int k = 0; k < faces; ++k) {
      Eigen::Vector3d at;
      for (int i = 0; i < 3; ++i) at[i] = random.uniform(low[i], high[i]);
      std::array<Eigen::Vector3d, 3> corner;
      for (Eigen::Vector3d& c : corner) {
        c = at + edge * Eigen::Vector3d(random.normal(), random.normal(), random.normal());
      }
      const Eigen::Vector3d normal = (corner[1] - corner[0]).cross(corner[2] - corner[0]);
      if (normal.dot(viewer - corner[0]) < 0) std::swap(corner[1], corner[2]);
      const std::uint32_t a = add(corner[0]);
      const std::uint32_t b = add(corner[1]);
      addFace({a, b, add(corner[2])});
    }
  }

  std::unique_ptr<LocalMesh> mesh;
  std::unique_ptr<SmoothedWindow> window;
  Random random;

 private:
  double depth_sigma_ = 0.01;
  TrackId next_id_ = 1;
};

/// Floor, ceiling and walls of a room around the origin, turned about z; `half` its half extents. Walls in
/// the order +x, +y, -x, -y of the room's axes.
inline void addRoom(PlaneScene& scene, const Eigen::Vector3d& half, double yaw, int walls = 4) {
  const Eigen::Matrix3d R = Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  const auto sheet = [&](const Eigen::Vector3d& corner, const Eigen::Vector3d& along,
                         const Eigen::Vector3d& across) {
    scene.addSheet({R * corner, R * along, R * across, 8, 8});
  };
  const double x = half.x();
  const double y = half.y();
  const double z = half.z();
  sheet({-x, -y, -z}, {2 * x, 0, 0}, {0, 2 * y, 0});
  sheet({-x, -y, z}, {0, 2 * y, 0}, {2 * x, 0, 0});
  const Eigen::Vector3d up(0, 0, 2 * z);
  if (walls > 0) sheet({x, -y, -z}, up, {0, 2 * y, 0});
  if (walls > 1) sheet({x, y, -z}, up, {-2 * x, 0, 0});
  if (walls > 2) sheet({-x, y, -z}, up, {0, -2 * y, 0});
  if (walls > 3) sheet({-x, -y, -z}, up, {2 * x, 0, 0});
}

}  // namespace swiftlet::test
