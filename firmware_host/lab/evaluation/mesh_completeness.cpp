#include "firmware_host/lab/evaluation/mesh_completeness.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "firmware_host/lab/evaluation/error_statistics.hpp"

namespace swiftlet {
namespace {

/// Solid angle of a square of `size` pixels around `pixel`, from the lens model's derivative.
double solidAngle(const CameraModel& camera, const Eigen::Vector2d& pixel, double size) {
  constexpr double kHalf = 0.5;  ///< px, for the difference quotient
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

/// Whether the pixel is inside, by the number of edges that a line to the right crosses.
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
                        const MeshDistance* truth) {
  SeenSurface seen;
  seen.camera = T_world_cam.translation;
  if (polygon.size() < 3 || grid.pixels() == 0) return seen;
  for (const RayGrid::Ray& ray : grid.rays()) {
    if (!inside(polygon, ray.pixel)) continue;
    SeenRay& added = seen.rays.emplace_back(SeenRay{T_world_cam.rotation * ray.bearing});
    const auto hit = truth == nullptr ? std::nullopt : truth->cast(seen.camera, added.direction);
    if (!hit) continue;
    const double cosine = std::max(std::abs(truth->normal(hit->face).dot(added.direction)), kLeastCosine);
    added.distance = hit->distance;
    added.area = ray.solid_angle * hit->distance * hit->distance / cosine;
  }
  seen.polygon_share = static_cast<double>(seen.rays.size()) / static_cast<double>(grid.pixels());
  return seen;
}

void Completeness::add(const Completeness& other) {
  rays += other.rays;
  drawn += other.drawn;
  squared_errors += other.squared_errors;
  seen += other.seen;
  covered += other.covered;
  seen_area += other.seen_area;
  covered_area += other.covered_area;
}

double Completeness::share() const { return shareOf(covered, seen); }

double Completeness::drawnShare() const { return shareOf(drawn, rays); }

double Completeness::relativeRmse() const {
  return drawn == 0 ? 0 : std::sqrt(squared_errors / static_cast<double>(drawn));
}

double Completeness::areaShare() const { return seen_area > 0 ? covered_area / seen_area : 0; }

Completeness completenessOf(const SeenSurface& seen, const MeshDistance& mesh, const MeshDistance* truth) {
  Completeness result;
  result.rays = seen.rays.size();
  for (const SeenRay& ray : seen.rays) {
    if (const auto hit = mesh.cast(seen.camera, ray.direction)) {
      ++result.drawn;
      const auto near =
          truth == nullptr ? std::nullopt : truth->nearest(seen.camera + hit->distance * ray.direction);
      if (near) result.squared_errors += std::pow(near->distance / hit->distance, 2);
    }
    if (ray.distance <= 0) continue;
    ++result.seen;
    result.seen_area += ray.area;
    if (!mesh.nearest(seen.camera + ray.distance * ray.direction, kCovered)) continue;
    ++result.covered;
    result.covered_area += ray.area;
  }
  return result;
}

}  // namespace swiftlet
