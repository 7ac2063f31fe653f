#include "mesher/plane_drawing.hpp"

#include <algorithm>
#include <cmath>

#include "estimator/core/fixed_vector.hpp"

namespace swiftlet {
namespace {

// Standard deviation across the line of sight: about one pixel.
constexpr double kLateralSigma = 0.002;  // of the depth
// A plane moves slightly between the report's keyframe and the solve with which it is drawn.
constexpr double kMaxSigmas = 4;
constexpr double kLeastGate = 0.05;  // m

}  // namespace

std::optional<KnownPlane> knownPlane(std::uint64_t id, const PlaneReport& report,
                                     const SmoothedWindow& window) {
  for (const WindowPlane& plane : window.planes) {
    if (plane.id == id) return KnownPlane{plane.normal, plane.distance};
  }
  for (const ReportedPlane& plane : report.planes) {
    if (plane.id == id) return KnownPlane{plane.normal, plane.distance};
  }
  return std::nullopt;
}

int drawOntoPlanes(const PlaneReport& report, const SmoothedWindow& window, double surface_sigma,
                   LocalMesh& mesh) {
  if (report.epoch != mesh.epoch || window.epoch != mesh.epoch || window.poses.empty()) return 0;
  FixedVector<ReportedPoint, kMaxLandmarks> points = report.points;
  std::sort(points.begin(), points.end(),
            [](const ReportedPoint& a, const ReportedPoint& b) { return a.id < b.id; });
  struct Known {
    TrackId id = 0;
    double inverse_depth_sigma = 0;
  };
  FixedVector<Known, kMaxLandmarks> known;
  for (const WindowLandmark& landmark : window.landmarks) {
    static_cast<void>(known.tryPushBack({landmark.id, landmark.inverse_depth_sigma}));
  }
  std::sort(known.begin(), known.end(), [](const Known& a, const Known& b) { return a.id < b.id; });
  const Eigen::Vector3d viewer = window.poses.back().T_world_body.translation;
  const auto before = [](const auto& entry, TrackId id) { return entry.id < id; };
  int moved = 0;
  for (MeshVertex& vertex : mesh.vertices) {
    const auto* point = std::lower_bound(points.begin(), points.end(), vertex.id, before);
    if (point == points.end() || point->id != vertex.id) continue;
    const std::optional<KnownPlane> plane = knownPlane(point->plane, report, window);
    if (!plane) continue;
    const Eigen::Vector3d p = vertex.p_world.cast<double>();
    const double height = plane->normal.dot(p) - plane->distance;
    const auto* landmark = std::lower_bound(known.begin(), known.end(), vertex.id, before);
    if (landmark == known.end() || landmark->id != vertex.id) continue;
    const Eigen::Vector3d ray = p - viewer;
    const double depth = ray.norm();
    const double depth_sigma = landmark->inverse_depth_sigma * depth;  // over the depth: ray is not unit
    const double lateral = kLateralSigma * depth;
    const Eigen::Vector3d spread =
        depth_sigma * depth_sigma * plane->normal.dot(ray) * ray + lateral * lateral * plane->normal;
    const double variance = plane->normal.dot(spread);
    if (!(std::abs(height) <= std::max(kLeastGate, kMaxSigmas * std::sqrt(variance)))) continue;
    const Eigen::Vector3d step = height / (variance + surface_sigma * surface_sigma) * spread;
    if (!step.allFinite()) continue;
    vertex.p_world = (p - step).cast<float>();
    ++moved;
  }
  return moved;
}

}  // namespace swiftlet
