#include "mesher/obstacle_queries.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "estimator/core/fixed_vector.hpp"

namespace swiftlet {
namespace {

// A triangle cut by six half-spaces has nine corners at most.
using Polygon = FixedVector<Eigen::Vector3f, 9>;

/// Keeps what has side * p[axis] <= limit.
void cut(const Polygon& polygon, int axis, float side, float limit, Polygon& out) {
  out.clear();
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Eigen::Vector3f& p = polygon[i];
    const Eigen::Vector3f& q = polygon[(i + 1) % polygon.size()];
    const float beyond_p = side * p[axis] - limit;
    const float beyond_q = side * q[axis] - limit;
    if (beyond_p <= 0) static_cast<void>(out.tryPushBack(p));
    if ((beyond_p < 0 && beyond_q > 0) || (beyond_p > 0 && beyond_q < 0)) {
      static_cast<void>(out.tryPushBack(p + (q - p) * (beyond_p / (beyond_p - beyond_q))));
    }
  }
}

/// Of the convex polygon, nearest to the origin.
Eigen::Vector3f nearestToOrigin(const Polygon& polygon, const Eigen::Vector3f& normal) {
  // The foot of the perpendicular, if it lies inside all edges.
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
      cut(polygon[current], side / 2, sign, half_size[side / 2], polygon[1 - current]);
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

}  // namespace swiftlet
