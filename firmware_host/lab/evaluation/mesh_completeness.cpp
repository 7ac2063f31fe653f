#include "firmware_host/lab/evaluation/mesh_completeness.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace swiftlet {
namespace {

/// Solid angle of a square of `size` pixels around `pixel`, by the lens model's derivative there.
double solidAngle(const CameraModel& camera, const Eigen::Vector2d& pixel, double size) {
  constexpr double kHalf = 0.5;  ///< px, of the difference quotient
  Eigen::Vector3d left;
  Eigen::Vector3d right;
  Eigen::Vector3d above;
  Eigen::Vector3d below;
  const bool known = camera.unproject(pixel - Eigen::Vector2d(kHalf, 0), left) &&
                     camera.unproject(pixel + Eigen::Vector2d(kHalf, 0), right) &&
                     camera.unproject(pixel - Eigen::Vector2d(0, kHalf), above) &&
                     camera.unproject(pixel + Eigen::Vector2d(0, kHalf), below);
  return known ? (right - left).cross(below - above).norm() * size * size : 0;
}

/// By the number of edges that a line to the right crosses.
bool inside(std::span<const Eigen::Vector2f> polygon, const Eigen::Vector2d& pixel) {
  bool odd = false;
  for (std::size_t i = 0, j = polygon.size() - 1; i < polygon.size(); j = i++) {
    const Eigen::Vector2d a = polygon[i].cast<double>();
    const Eigen::Vector2d b = polygon[j].cast<double>();
    if ((a.y() > pixel.y()) == (b.y() > pixel.y())) continue;
    const double crossing = a.x() + (pixel.y() - a.y()) / (b.y() - a.y()) * (b.x() - a.x());
    if (pixel.x() < crossing) odd = !odd;
  }
  return odd;
}

}  // namespace

RayGrid::RayGrid(const CameraModel& camera, int step) {
  for (int v = step / 2; v < camera.height(); v += step) {
    for (int u = step / 2; u < camera.width(); u += step) {
      ++pixels_;
      Ray ray;
      ray.pixel = Eigen::Vector2d(u, v);
      if (!camera.unproject(ray.pixel, ray.bearing)) continue;
      ray.solid_angle = solidAngle(camera, ray.pixel, step);
      rays_.push_back(ray);
    }
  }
}

SeenSurface seenSurface(const RayGrid& grid, std::span<const Eigen::Vector2f> polygon, const SE3& T_world_cam,
                        const MeshDistance& truth) {
  SeenSurface seen;
  if (polygon.size() < 3 || grid.pixels() == 0) return seen;
  std::size_t pixels = 0;
  for (const RayGrid::Ray& ray : grid.rays()) {
    if (!inside(polygon, ray.pixel)) continue;
    ++pixels;
    const Eigen::Vector3d direction = T_world_cam.rotation * ray.bearing;
    const auto hit = truth.cast(T_world_cam.translation, direction);
    if (!hit) continue;
    const double cosine = std::max(std::abs(truth.normal(hit->face).dot(direction)), kLeastCosine);
    seen.points.push_back({T_world_cam.translation + hit->distance * direction,
                           ray.solid_angle * hit->distance * hit->distance / cosine});
  }
  seen.polygon_share = static_cast<double>(pixels) / static_cast<double>(grid.pixels());
  return seen;
}

void Completeness::add(const Completeness& other) {
  seen += other.seen;
  covered += other.covered;
  seen_area += other.seen_area;
  covered_area += other.covered_area;
}

double Completeness::share() const {
  return seen == 0 ? 0 : static_cast<double>(covered) / static_cast<double>(seen);
}

double Completeness::areaShare() const { return seen_area > 0 ? covered_area / seen_area : 0; }

Completeness completenessOf(std::span<const SeenPoint> points, const MeshDistance& mesh) {
  Completeness result;
  result.seen = points.size();
  for (const SeenPoint& seen : points) {
    result.seen_area += seen.area;
    if (!mesh.nearest(seen.point, kCovered)) continue;
    ++result.covered;
    result.covered_area += seen.area;
  }
  return result;
}

}  // namespace swiftlet
