#pragma once
// Fits a guessed plane to a mesh: selects its faces and vertices, refines it, and measures its support.
//
// Least squares over the vertices of the faces in the plane, each weighted by its noise along the normal. The
// direction is constrained: a horizontal plane has only a distance, a vertical one azimuth and distance
// (weighted principal axis of the vertices seen from above). No allocation.
// Cost: four passes over the faces, one over the vertices.

#include <Eigen/Core>
#include <array>
#include <cstdint>

#include "estimator/messages/local_mesh.hpp"
#include "mesher/plane_facts.hpp"
#include "mesher/plane_votes.hpp"

namespace swiftlet {

/// Largest distance of a vertex from its plane, whatever its noise.
inline constexpr float kPlaneGate = 0.05F;  // m
/// Deviation of real walls from a plane: posters, skirtings, mats, plaster (1 sigma).
inline constexpr float kSurfaceSigma = 0.008F;  // m

/// Support of a plane in one keyframe.
struct PlaneSupport {
  int points = 0;
  int known = 0;          ///< points with a sigma below half of the gate; others would fit a bent surface too
  float area = 0;         ///< m^2 of its faces
  float narrow = 0;       ///< m, standard deviation of its points along the narrower direction in the plane
  float rms = 0;          ///< m, of its points' distances
  float turn_sigma = 0;   ///< rad, sigma of a vertical plane's azimuth; 0 for a horizontal one
  float chi_squared = 0;  ///< mean of the squared distances in sigmas
  /// Share of the well-known vertices in a slab around the plane, within its extent, that are on it.
  float share = 0;
  Eigen::Vector3f centre = Eigen::Vector3f::Zero();  ///< m, from the viewer
};

/// m, standard deviation of a vertex along a normal.
float normalSigma(const VertexFacts& vertex, const Eigen::Vector3f& normal);

class PlaneFit {
 public:
  /// Fits the guess to its vertices. `known`: the guess is from an earlier keyframe instead of votes, so it
  /// is already near. False without enough vertices.
  [[nodiscard]] bool refine(const LocalMesh& mesh, const MeshFacts& facts, PlaneGuess& plane, bool known);
  /// Support of the plane that refine() returned.
  [[nodiscard]] const PlaneSupport& support() const { return support_; }
  /// m, as `narrow`, but of the larger part only if the points form two separate parts. Two objects may lie
  /// in one plane by chance, such as the front of a column and the edge of a shelf behind it; they do not
  /// support a plane between them.
  [[nodiscard]] float narrowOfLargerPart(const MeshFacts& facts);
  /// Whether the face lies in the plane and belongs to no other.
  [[nodiscard]] bool holds(std::size_t face) const { return face_in_[face] != 0; }

 private:
  void collect(const LocalMesh& mesh, const MeshFacts& facts, const PlaneGuess& plane, float gate,
               bool by_noise);
  [[nodiscard]] bool solve(const MeshFacts& facts, PlaneGuess& plane);
  void judge(const MeshFacts& facts, const PlaneGuess& plane);

  std::array<std::uint8_t, kMaxMeshVertices> vertex_in_{};
  std::array<std::uint8_t, kMaxMeshFaces> face_in_{};
  PlaneSupport support_;
  float turn_sigma_ = 0;  // of the last solve
  Eigen::Vector3f narrow_axis_ = Eigen::Vector3f::Zero();
  std::array<float, kMaxMeshVertices> places_{};  // positions along narrow_axis_
};

}  // namespace swiftlet
