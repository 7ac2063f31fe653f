#include "mesher/obstacle_queries.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <bitset>
#include <cmath>
#include <limits>
#include <numbers>

#include "estimator/core/fixed_vector.hpp"

namespace swiftlet {
namespace {

// A triangle cut by six half-spaces has nine corners at most.
using Polygon = FixedVector<Eigen::Vector3f, 9>;

/// Keeps the part of the polygon with normal . p <= limit.
void cut(const Polygon& polygon, const Eigen::Vector3f& normal, float limit, Polygon& out) {
  out.clear();
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Eigen::Vector3f& p = polygon[i];
    const Eigen::Vector3f& q = polygon[(i + 1) % polygon.size()];
    const float beyond_p = normal.dot(p) - limit;
    const float beyond_q = normal.dot(q) - limit;
    if (beyond_p <= 0) static_cast<void>(out.tryPushBack(p));
    if ((beyond_p < 0 && beyond_q > 0) || (beyond_p > 0 && beyond_q < 0)) {
      static_cast<void>(out.tryPushBack(p + (q - p) * (beyond_p / (beyond_p - beyond_q))));
    }
  }
}

/// Point of the convex polygon that is nearest to the origin.
Eigen::Vector3f nearestToOrigin(const Polygon& polygon, const Eigen::Vector3f& normal) {
  // The foot of the perpendicular, if it lies inside the polygon.
  const float square = normal.squaredNorm();
  if (square > 0) {
    const Eigen::Vector3f foot = normal * (normal.dot(polygon[0]) / square);
    bool inside = true;
    for (std::size_t i = 0; i < polygon.size() && inside; ++i) {
      const Eigen::Vector3f edge = polygon[(i + 1) % polygon.size()] - polygon[i];
      inside = normal.dot(edge.cross(foot - polygon[i])) >= 0;
    }
    if (inside) return foot;
  }
  Eigen::Vector3f best = polygon[0];
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Eigen::Vector3f edge = polygon[(i + 1) % polygon.size()] - polygon[i];
    const float length = edge.squaredNorm();
    const float at = length > 0 ? std::clamp(-edge.dot(polygon[i]) / length, 0.0F, 1.0F) : 0.0F;
    const Eigen::Vector3f candidate = polygon[i] + at * edge;
    if (candidate.squaredNorm() < best.squaredNorm()) best = candidate;
  }
  return best;
}

constexpr int kSectors = static_cast<int>(kObstacleSectors);
constexpr float kSectorWidth = 2 * std::numbers::pi_v<float> / static_cast<float>(kObstacleSectors);
/// Azimuths at which a sector must have a face to be free: every 0.6 degrees, 0.2 m apart at 20 m, less than
/// a vehicle's width.
constexpr int kRaysPerSector = 8;
using CrossedRays = std::bitset<kObstacleSectors * kRaysPerSector>;
constexpr float kRayWidth = kSectorWidth / static_cast<float>(kRaysPerSector);

/// Sectors and rays are numbered from the heading on, in both directions and beyond a full turn.
std::size_t wrapped(int index, int count) {
  return static_cast<std::size_t>((index % count + count) % count);
}

/// Horizontal distance from the origin to the convex polygon, which must not surround it.
float horizontalDistance(const Polygon& polygon) {
  float best = kNothingKnown;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Eigen::Vector2f p = polygon[i].head<2>();
    const Eigen::Vector2f edge = polygon[(i + 1) % polygon.size()].head<2>() - p;
    const float length = edge.squaredNorm();
    const float at = length > 0 ? std::clamp(-edge.dot(p) / length, 0.0F, 1.0F) : 0.0F;
    best = std::min(best, (p + at * edge).norm());
  }
  return best;
}

/// Azimuths [rad], from x to y, that a polygon covers; `around` if it surrounds the origin.
struct Azimuths {
  float low = 0;
  float high = 0;
  bool around = false;
};

Azimuths azimuthsOf(const Polygon& polygon) {
  Azimuths azimuths;
  const float begin = std::atan2(polygon[0].y(), polygon[0].x());
  float angle = 0;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Eigen::Vector3f& p = polygon[i];
    const Eigen::Vector3f& q = polygon[(i + 1) % polygon.size()];
    angle += std::atan2(p.x() * q.y() - p.y() * q.x(), p.x() * q.x() + p.y() * q.y());
    azimuths.low = std::min(azimuths.low, angle);
    azimuths.high = std::max(azimuths.high, angle);
  }
  // A whole turn in one direction, not back and forth.
  azimuths.around = std::abs(angle) > std::numbers::pi_v<float>;
  azimuths.low += begin;
  azimuths.high += begin;
  return azimuths;
}

/// Updates the distances in the sectors, and the rays, that the polygon crosses.
void addToSectors(const Polygon& polygon, SectorDistances& nearest, CrossedRays& crossed) {
  const Azimuths azimuths = azimuthsOf(polygon);
  if (azimuths.around) {
    nearest.fill(0);
    return;
  }
  const int first = static_cast<int>(std::floor(azimuths.low / kSectorWidth + 0.5F));
  const int last = static_cast<int>(std::floor(azimuths.high / kSectorWidth + 0.5F));
  for (int sector = first; sector <= std::min(last, first + kSectors - 1); ++sector) {
    const float left = (static_cast<float>(sector) - 0.5F) * kSectorWidth;
    const float right = left + kSectorWidth;
    Polygon half;
    Polygon part;
    cut(polygon, {std::sin(left), -std::cos(left), 0}, 0, half);
    if (half.empty()) continue;
    cut(half, {-std::sin(right), std::cos(right), 0}, 0, part);
    if (part.empty()) continue;
    float& known = nearest[wrapped(sector, kSectors)];
    known = std::min(known, horizontalDistance(part));
    for (int ray = sector * kRaysPerSector; ray < (sector + 1) * kRaysPerSector; ++ray) {
      const float azimuth = (static_cast<float>(ray) + 0.5F) * kRayWidth - 0.5F * kSectorWidth;
      if (azimuth >= azimuths.low && azimuth <= azimuths.high) {
        crossed.set(wrapped(ray, kSectors * kRaysPerSector));
      }
    }
  }
}

}  // namespace

std::optional<Obstacle> nearestAlongRay(const LocalMesh& mesh, const Eigen::Vector3f& origin,
                                        const Eigen::Vector3f& direction, float reach) {
  const Eigen::Vector3f along = direction.normalized();
  std::optional<Obstacle> best;
  float nearest = reach;
  for (std::size_t i = 0; i < mesh.faces.size(); ++i) {
    const MeshFace& face = mesh.faces[i];
    const Eigen::Vector3f& a = mesh.vertices[face.vertex[0]].p_world;
    const Eigen::Vector3f ab = mesh.vertices[face.vertex[1]].p_world - a;
    const Eigen::Vector3f ac = mesh.vertices[face.vertex[2]].p_world - a;
    const Eigen::Vector3f across = along.cross(ac);
    const float determinant = ab.dot(across);
    if (determinant == 0) continue;
    const Eigen::Vector3f from_a = origin - a;
    const float u = from_a.dot(across) / determinant;
    const Eigen::Vector3f turned = from_a.cross(ab);
    const float v = along.dot(turned) / determinant;
    const float t = ac.dot(turned) / determinant;
    if (!(u >= 0 && v >= 0 && u + v <= 1 && t >= 0 && t <= nearest)) continue;
    nearest = t;
    best = Obstacle{origin + t * along, t, i, face.label};
  }
  return best;
}

std::optional<Obstacle> nearestInBox(const LocalMesh& mesh, const SE3& T_world_box,
                                     const Eigen::Vector3f& half_size) {
  const SE3 T_box_world = T_world_box.inverse();
  const Eigen::Matrix3f R = T_box_world.rotation.toRotationMatrix().cast<float>();
  const Eigen::Vector3f t = T_box_world.translation.cast<float>();
  std::optional<Obstacle> best;
  float nearest = std::numeric_limits<float>::max();
  for (std::size_t i = 0; i < mesh.faces.size(); ++i) {
    const MeshFace& face = mesh.faces[i];
    std::array<Polygon, 2> polygon;
    for (const std::uint32_t v : face.vertex) {
      static_cast<void>(polygon[0].tryPushBack(R * mesh.vertices[v].p_world + t));
    }
    const Polygon& corners = polygon[0];
    const Eigen::Vector3f low = corners[0].cwiseMin(corners[1]).cwiseMin(corners[2]);
    const Eigen::Vector3f high = corners[0].cwiseMax(corners[1]).cwiseMax(corners[2]);
    if ((low.array() > half_size.array()).any() || (high.array() < -half_size.array()).any()) continue;
    const Eigen::Vector3f normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
    std::size_t current = 0;
    for (int side = 0; side < 6 && !polygon[current].empty(); ++side) {
      const float sign = side % 2 == 0 ? 1.0F : -1.0F;
      cut(polygon[current], sign * Eigen::Vector3f::Unit(side / 2), half_size[side / 2],
          polygon[1 - current]);
      current = 1 - current;
    }
    if (polygon[current].empty()) continue;
    const Eigen::Vector3f point = nearestToOrigin(polygon[current], normal);
    if (point.norm() >= nearest) continue;
    nearest = point.norm();
    best = Obstacle{R.transpose() * (point - t), nearest, i, face.label};
  }
  return best;
}

SectorDistances nearestBySector(const LocalMesh& mesh, const SectorQuery& query) {
  SectorDistances nearest;
  nearest.fill(kNothingKnown);
  CrossedRays crossed;
  // Forward, right, up: azimuths run clockwise.
  const float c = std::cos(query.heading);
  const float s = std::sin(query.heading);
  const auto inVehicle = [&](const Eigen::Vector3f& p_world) {
    const Eigen::Vector3f d = p_world - query.origin;
    return Eigen::Vector3f(c * d.x() + s * d.y(), s * d.x() - c * d.y(), d.z());
  };
  for (const MeshFace& face : mesh.faces) {
    Polygon corners;
    for (const std::uint32_t v : face.vertex) {
      static_cast<void>(corners.tryPushBack(inVehicle(mesh.vertices[v].p_world)));
    }
    Polygon lower;
    Polygon band;
    cut(corners, Eigen::Vector3f::UnitZ(), query.above, lower);
    if (lower.empty()) continue;
    cut(lower, -Eigen::Vector3f::UnitZ(), query.below, band);
    if (!band.empty()) addToSectors(band, nearest, crossed);
  }
  for (std::size_t sector = 0; sector < kObstacleSectors; ++sector) {
    bool covered = true;
    for (std::size_t ray = 0; ray < kRaysPerSector; ++ray) {
      covered = covered && crossed[sector * kRaysPerSector + ray];
    }
    if (nearest[sector] > query.reach && !covered) nearest[sector] = kNothingKnown;
  }
  return nearest;
}

}  // namespace swiftlet
