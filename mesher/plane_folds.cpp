#include "mesher/plane_folds.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "estimator/core/fixed_vector.hpp"
#include "mesher/plane_drawing.hpp"

namespace swiftlet {
namespace {

// At smaller angles the planes' intersection line is much less accurate than the planes.
constexpr double kLeastSine = 0.5;  // 30 degrees
// Faces with a corner farther from the line do not span the fold.
constexpr double kFarthest = 1.0;  // m
// A corner nearer to the line is already on it: nothing to fold.
constexpr double kNearest = 0.02;  // m
// Tolerance for noise when testing whether both corners are in front of the other's plane, or both behind it
// (an outer edge).
constexpr double kSlack = 0.05;  // m

/// Intersection line of two planes.
struct Line {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();
  Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();
};

std::optional<Line> meet(const KnownPlane& a, const KnownPlane& b) {
  const Eigen::Vector3d along = a.normal.cross(b.normal);
  const double sine = along.norm();
  if (!(sine >= kLeastSine)) return std::nullopt;
  const Eigen::Vector3d direction = along / sine;
  const Eigen::Vector3d point =
      (a.distance * b.normal.cross(along) + b.distance * along.cross(a.normal)) / (sine * sine);
  return Line{point, direction};
}

class Folder {
 public:
  Folder(const PlaneReport& report, const SmoothedWindow& window, LocalMesh& mesh)
      : window_(window), report_(report), mesh_(mesh), landmarks_(mesh.vertices.size()) {
    FixedVector<ReportedPoint, kMaxLandmarks> points = report.points;
    const auto by_id = [](const ReportedPoint& a, const ReportedPoint& b) { return a.id < b.id; };
    std::sort(points.begin(), points.end(), by_id);
    for (std::size_t v = 0; v < landmarks_; ++v) {
      const ReportedPoint key{mesh.vertices[v].id, 0, true};
      const auto* found = std::lower_bound(points.begin(), points.end(), key, by_id);
      plane_[v] = found != points.end() && found->id == key.id ? found->plane : 0;
    }
  }

  int run() {
    int folded = 0;
    const std::size_t faces = mesh_.faces.size();
    for (std::size_t f = 0; f < faces; ++f) folded += fold(f) ? 1 : 0;
    return folded;
  }

 private:
  struct Crossing {
    std::uint32_t from = 0;
    std::uint32_t to = 0;
    std::uint32_t vertex = 0;
  };

  // The corner that is alone on its plane; 3 if the face cannot be folded.
  [[nodiscard]] std::size_t loneCorner(const MeshFace& face) const {
    for (const std::uint32_t v : face.vertex) {
      if (v >= landmarks_ || plane_[v] == 0) return 3;
    }
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint64_t a = plane_[face.vertex[(k + 1) % 3]];
      if (a == plane_[face.vertex[(k + 2) % 3]] && a != plane_[face.vertex[k]]) return k;
    }
    return 3;
  }

  bool fold(std::size_t index) {
    const MeshFace face = mesh_.faces[index];
    const std::size_t lone = loneCorner(face);
    if (lone == 3) return false;
    if (mesh_.faces.capacity() - mesh_.faces.size() < 2 ||
        mesh_.vertices.capacity() - mesh_.vertices.size() < 2 || kMaxFolds - crossings_.size() < 2) {
      return false;
    }
    const std::uint32_t b = face.vertex[lone];
    const std::uint32_t a1 = face.vertex[(lone + 1) % 3];
    const std::uint32_t a2 = face.vertex[(lone + 2) % 3];
    const std::optional<KnownPlane> plane_a = knownPlane(plane_[a1], report_, window_);
    const std::optional<KnownPlane> plane_b = knownPlane(plane_[b], report_, window_);
    if (!plane_a || !plane_b) return false;
    const std::optional<Line> line = meet(*plane_a, *plane_b);
    if (!line) return false;
    Eigen::Vector3d m1;
    Eigen::Vector3d m2;
    if (!cross(a1, b, *plane_a, *plane_b, *line, m1) || !cross(a2, b, *plane_a, *plane_b, *line, m2))
      return false;
    const std::uint32_t v1 = vertexAt(a1, b, m1);
    const std::uint32_t v2 = vertexAt(a2, b, m2);
    mesh_.faces[index].vertex = {b, v1, v2};
    static_cast<void>(mesh_.faces.tryPushBack({{v1, a1, a2}, face.label}));
    static_cast<void>(mesh_.faces.tryPushBack({{v1, a2, v2}, face.label}));
    return true;
  }

  [[nodiscard]] bool cross(std::uint32_t a, std::uint32_t b, const KnownPlane& plane_a,
                           const KnownPlane& plane_b, const Line& line, Eigen::Vector3d& crossing) const {
    const Eigen::Vector3d p = mesh_.vertices[a].p_world.cast<double>() - line.point;
    const Eigen::Vector3d q = mesh_.vertices[b].p_world.cast<double>() - line.point;
    const double along_p = line.direction.dot(p);
    const double along_q = line.direction.dot(q);
    const double off_p = (p - along_p * line.direction).norm();
    const double off_q = (q - along_q * line.direction).norm();
    if (!(std::max(off_p, off_q) <= kFarthest) || !(std::min(off_p, off_q) >= kNearest)) return false;
    // line.point is on both planes, so these are heights above the other's plane.
    const double over_b = plane_b.normal.dot(p);
    const double over_a = plane_a.normal.dot(q);
    const bool inner = over_a > -kSlack && over_b > -kSlack;
    const bool outer = over_a < kSlack && over_b < kSlack;
    if (!inner && !outer) return false;
    const double at = along_p + (along_q - along_p) * off_p / (off_p + off_q);
    crossing = line.point + at * line.direction;
    return crossing.allFinite();
  }

  std::uint32_t vertexAt(std::uint32_t a, std::uint32_t b, const Eigen::Vector3d& p) {
    const std::uint32_t from = std::min(a, b);
    const std::uint32_t to = std::max(a, b);
    for (const Crossing& crossing : crossings_) {
      if (crossing.from == from && crossing.to == to) return crossing.vertex;
    }
    const auto index = static_cast<std::uint32_t>(mesh_.vertices.size());
    const int grey = (int{mesh_.vertices[a].grey} + int{mesh_.vertices[b].grey}) / 2;
    static_cast<void>(mesh_.vertices.tryPushBack(
        {kFoldIds - crossings_.size(), p.cast<float>(), static_cast<std::uint8_t>(grey)}));
    static_cast<void>(crossings_.tryPushBack({from, to, index}));
    return index;
  }

  const SmoothedWindow& window_;
  const PlaneReport& report_;
  LocalMesh& mesh_;
  std::size_t landmarks_;
  std::array<std::uint64_t, kMaxMeshVertices> plane_{};
  FixedVector<Crossing, kMaxFolds> crossings_;
};

}  // namespace

int foldAtPlanes(const PlaneReport& report, const SmoothedWindow& window, LocalMesh& mesh) {
  if (report.epoch != mesh.epoch || window.epoch != mesh.epoch) return 0;
  return Folder(report, window, mesh).run();
}

}  // namespace swiftlet
