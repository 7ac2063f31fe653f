#include "mesher/plane_facts.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace swiftlet {
namespace {

// A smaller face is a line in single precision at some metres' distance.
constexpr float kMinArea = 1e-6F;  // m^2
// Assumed for a vertex that is not or no longer a landmark of the window: 5 % of the depth.
constexpr float kUnknownRelativeSigma = 0.05F;

}  // namespace

void MeshFacts::read(const LocalMesh& mesh, const SmoothedWindow& window) {
  refused = 0;
  viewer = window.poses.empty() ? Eigen::Vector3d::Zero() : window.poses.back().T_world_body.translation;
  known_.clear();
  for (const WindowLandmark& landmark : window.landmarks) {
    static_cast<void>(known_.tryPushBack({landmark.id, static_cast<float>(landmark.inverse_depth_sigma)}));
  }
  std::sort(known_.begin(), known_.end(), [](const Known& a, const Known& b) { return a.id < b.id; });

  vertices.clear();
  for (const MeshVertex& vertex : mesh.vertices) {
    VertexFacts facts;
    facts.p = (vertex.p_world.cast<double>() - viewer).cast<float>();
    const float depth = facts.p.norm();
    facts.finite = std::isfinite(depth) && depth > 0;
    if (facts.finite) {
      facts.ray = facts.p / depth;
      facts.depth_sigma = kUnknownRelativeSigma * depth;
      const Known* found = std::lower_bound(known_.begin(), known_.end(), vertex.id,
                                            [](const Known& a, TrackId id) { return a.id < id; });
      if (found != known_.end() && found->id == vertex.id) {
        const float sigma = found->inverse_depth_sigma * depth * depth;
        facts.measured = std::isfinite(sigma) && sigma > 0;
        if (facts.measured) facts.depth_sigma = sigma;
      }
    } else {
      ++refused;
    }
    static_cast<void>(vertices.tryPushBack(facts));
  }

  faces.clear();
  for (const MeshFace& face : mesh.faces) {
    FaceFacts facts;
    const auto usable = [this](std::uint32_t v) { return v < vertices.size() && vertices[v].finite; };
    if (std::all_of(face.vertex.begin(), face.vertex.end(), usable)) {
      const Eigen::Vector3f& a = vertices[face.vertex[0]].p;
      const Eigen::Vector3f cross = (vertices[face.vertex[1]].p - a).cross(vertices[face.vertex[2]].p - a);
      const float twice = cross.norm();
      if (std::isfinite(twice) && twice > 2 * kMinArea) {
        facts.area = 0.5F * twice;
        facts.normal = cross / twice;
      }
    } else {
      ++refused;
    }
    static_cast<void>(faces.tryPushBack(facts));
  }
}

}  // namespace swiftlet
