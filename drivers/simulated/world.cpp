#include "drivers/simulated/world.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace swiftlet {
namespace {

constexpr double kPi = std::numbers::pi;

struct LocalHit {
  double distance = 0;
  double u = 0;
  double v = 0;
};

double azimuth(double x, double y) {
  const double angle = std::atan2(y, x);
  return angle < 0 ? angle + 2 * kPi : angle;
}

bool hitFlat(const Patch& patch, const Eigen::Vector3d& o, const Eigen::Vector3d& d, bool both_sides,
             LocalHit& hit) {
  const Eigen::Vector3d normal = patch.u_axis.cross(patch.v_axis);
  const double facing = normal.dot(d);
  if (facing == 0 || (facing > 0 && !both_sides)) return false;
  hit.distance = normal.dot(patch.origin - o) / facing;
  const Eigen::Vector3d p = o + hit.distance * d - patch.origin;
  hit.u = p.dot(patch.u_axis);
  hit.v = p.dot(patch.v_axis);
  if (hit.u < 0 || hit.v < 0 || hit.u > patch.u_length || hit.v > patch.v_length) return false;
  return patch.shape != Shape::kDisc ||
         std::hypot(hit.u - patch.radius, hit.v - patch.radius) <= patch.radius;
}

bool hitRound(const Patch& patch, const Eigen::Vector3d& o, const Eigen::Vector3d& d, LocalHit& hit) {
  Eigen::Vector3d p = o - patch.origin;
  Eigen::Vector3d q = d;
  const bool cylinder = patch.shape == Shape::kCylinder;
  if (cylinder) p.z() = q.z() = 0;
  const double a = q.squaredNorm();
  const double b = p.dot(q);
  const double discriminant = b * b - a * (p.squaredNorm() - patch.radius * patch.radius);
  if (!(discriminant > 0) || a == 0) return false;
  hit.distance = (-b - std::sqrt(discriminant)) / a;  // the near root: the outside
  const Eigen::Vector3d at = o + hit.distance * d - patch.origin;
  hit.u = patch.radius * azimuth(at.dot(patch.u_axis), at.dot(Eigen::Vector3d::UnitZ().cross(patch.u_axis)));
  if (cylinder) {
    hit.v = at.z();
    return hit.v >= 0 && hit.v <= patch.v_length;
  }
  hit.v = patch.radius * (std::asin(std::clamp(at.z() / patch.radius, -1.0, 1.0)) + kPi / 2);
  return true;
}

bool hitPatch(const Patch& patch, const Eigen::Vector3d& o, const Eigen::Vector3d& d, bool both_sides,
              LocalHit& hit) {
  const bool flat = patch.shape == Shape::kRectangle || patch.shape == Shape::kDisc;
  return flat ? hitFlat(patch, o, d, both_sides, hit) : hitRound(patch, o, d, hit);
}

// Whether the line passes outside the bounding sphere.
bool misses(const World::Bound& bound, const Eigen::Vector3d& o, const Eigen::Vector3d& d, double d_squared) {
  const Eigen::Vector3d to = bound.centre - o;
  const double along = to.dot(d);
  return to.squaredNorm() - along * along / d_squared > bound.radius * bound.radius;
}

// Triangulates a patch as a grid, with two triangles per cell.
void addGrid(const Patch& patch, int columns, int rows, SurfaceMesh& mesh) {
  const auto base = static_cast<std::uint32_t>(mesh.vertices.size());
  const auto stride = static_cast<std::uint32_t>(columns + 1);
  for (int j = 0; j <= rows; ++j) {
    for (int i = 0; i <= columns; ++i) {
      mesh.vertices.push_back(
          patch.pointAt(patch.u_length * i / columns, patch.v_length * j / rows).cast<float>());
    }
  }
  for (std::uint32_t j = 0; j < static_cast<std::uint32_t>(rows); ++j) {
    for (std::uint32_t i = 0; i < static_cast<std::uint32_t>(columns); ++i) {
      const std::uint32_t corner = base + j * stride + i;
      mesh.triangles.push_back({{corner, corner + 1, corner + stride + 1}, patch.label});
      mesh.triangles.push_back({{corner, corner + stride + 1, corner + stride}, patch.label});
    }
  }
}

void addFan(const Patch& patch, int steps, SurfaceMesh& mesh) {
  const auto base = static_cast<std::uint32_t>(mesh.vertices.size());
  mesh.vertices.push_back(patch.pointAt(patch.radius, patch.radius).cast<float>());
  for (int i = 0; i < steps; ++i) {
    const double angle = 2 * kPi * i / steps;
    mesh.vertices.push_back(
        patch.pointAt(patch.radius * (1 + std::cos(angle)), patch.radius * (1 + std::sin(angle)))
            .cast<float>());
  }
  const auto count = static_cast<std::uint32_t>(steps);
  for (std::uint32_t i = 0; i < count; ++i) {
    mesh.triangles.push_back({{base, base + 1 + i, base + 1 + (i + 1) % count}, patch.label});
  }
}

}  // namespace

const char* labelName(Label label) {
  static constexpr std::array<const char*, kLabelCount> kNames{
      "unknown", "floor", "ceiling", "wall",    "pillar", "shelf",  "table",
      "chair",   "box",   "poster",  "machine", "ball",   "barrel", "lamp"};
  return kNames[static_cast<std::size_t>(label)];
}

Eigen::Vector3d Patch::pointAt(double u, double v) const {
  switch (shape) {
    case Shape::kRectangle:
    case Shape::kDisc:
      return origin + u * u_axis + v * v_axis;
    case Shape::kCylinder:
      return origin + radius * normalAt(u, v) + v * Eigen::Vector3d::UnitZ();
    case Shape::kSphere:
      break;
  }
  return origin + radius * normalAt(u, v);
}

Eigen::Vector3d Patch::normalAt(double u, double v) const {
  if (shape == Shape::kRectangle || shape == Shape::kDisc) return u_axis.cross(v_axis);
  const double angle = u / radius;
  const Eigen::Vector3d side = Eigen::Vector3d::UnitZ().cross(u_axis);
  const Eigen::Vector3d around = std::cos(angle) * u_axis + std::sin(angle) * side;
  if (shape == Shape::kCylinder) return around;
  const double latitude = v / radius - kPi / 2;
  return std::cos(latitude) * around + std::sin(latitude) * Eigen::Vector3d::UnitZ();
}

double Patch::area() const {
  if (shape == Shape::kDisc) return kPi * radius * radius;
  if (shape == Shape::kSphere) return 4 * kPi * radius * radius;
  return u_length * v_length;
}

void World::finish() {
  bounds_.clear();
  cumulative_area_.clear();
  double area = 0;
  for (const Patch& patch : patches_) {
    Bound bound;
    if (patch.shape == Shape::kSphere) {
      bound = {patch.origin, patch.radius};
    } else if (patch.shape == Shape::kCylinder) {
      bound.centre = patch.origin + 0.5 * patch.v_length * Eigen::Vector3d::UnitZ();
      bound.radius = std::hypot(patch.radius, 0.5 * patch.v_length);
    } else {
      bound.centre = patch.pointAt(0.5 * patch.u_length, 0.5 * patch.v_length);
      bound.radius = 0.5 * std::hypot(patch.u_length, patch.v_length);
    }
    bounds_.push_back(bound);
    area += patch.area();
    cumulative_area_.push_back(area);
  }
}

std::optional<RayHit> World::castRay(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction,
                                     double nearest, double farthest) const {
  std::optional<RayHit> best;
  const double d_squared = direction.squaredNorm();
  for (std::size_t i = 0; i < patches_.size(); ++i) {
    if (misses(bounds_[i], origin, direction, d_squared)) continue;
    LocalHit hit;
    if (!hitPatch(patches_[i], origin, direction, false, hit)) continue;
    if (hit.distance < nearest || hit.distance > farthest) continue;
    farthest = hit.distance;
    best = RayHit{i, hit.distance, hit.u, hit.v};
  }
  return best;
}

bool World::sees(const Eigen::Vector3d& from, const Eigen::Vector3d& to, double slack) const {
  const Eigen::Vector3d direction = to - from;
  const double length = direction.norm();
  if (length <= 2 * slack) return true;
  const double nearest = slack / length;
  for (std::size_t i = 0; i < patches_.size(); ++i) {
    if (misses(bounds_[i], from, direction, length * length)) continue;
    LocalHit hit;
    if (!hitPatch(patches_[i], from, direction, true, hit)) continue;
    if (hit.distance > nearest && hit.distance < 1.0 - nearest) return false;
  }
  return true;
}

SurfacePoint World::drawPoint(Random& random) const {
  const double area = random.uniform(0.0, cumulative_area_.back());
  const auto found = std::upper_bound(cumulative_area_.begin(), cumulative_area_.end(), area);
  SurfacePoint point;
  point.patch = std::min(static_cast<std::size_t>(found - cumulative_area_.begin()), patches_.size() - 1);
  const Patch& patch = patches_[point.patch];
  point.u = random.uniform(0.0, patch.u_length);
  point.v = random.uniform(0.0, patch.v_length);
  if (patch.shape == Shape::kDisc) {
    const double r = patch.radius * std::sqrt(random.uniform());
    const double angle = random.uniform(0.0, 2 * kPi);
    point.u = patch.radius + r * std::cos(angle);
    point.v = patch.radius + r * std::sin(angle);
  } else if (patch.shape == Shape::kSphere) {
    point.v = patch.radius * (std::asin(random.uniform(-1.0, 1.0)) + kPi / 2);
  }
  point.position = patch.pointAt(point.u, point.v);
  point.normal = patch.normalAt(point.u, point.v);
  return point;
}

SurfaceMesh World::mesh(double tolerance) const {
  SurfaceMesh mesh;
  for (const Patch& patch : patches_) {
    if (patch.shape == Shape::kRectangle) {
      addGrid(patch, 1, 1, mesh);
      continue;
    }
    // A chord of angle a deviates from the circle by r (1 - cos(a / 2)).
    const double angle = 2 * std::acos(std::max(0.0, 1.0 - tolerance / patch.radius));
    const int steps = std::max(8, static_cast<int>(std::ceil(2 * kPi / angle)));
    if (patch.shape == Shape::kDisc) addFan(patch, steps, mesh);
    if (patch.shape == Shape::kCylinder) addGrid(patch, steps, 1, mesh);
    if (patch.shape == Shape::kSphere) addGrid(patch, steps, steps / 2, mesh);
  }
  return mesh;
}

}  // namespace swiftlet
