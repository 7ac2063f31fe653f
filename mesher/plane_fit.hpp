#pragma once
// A guessed plane against a mesh: which faces and vertices it has, where they put it, and whether it is one.
//
// Least squares over the vertices of the faces that lie in the plane, each vertex weighed by its noise along
// the normal, with the direction held: a horizontal plane has its distance alone, a vertical one azimuth and
// distance (weighted principal axis of the vertices' plan). Nothing is allocated.
// Cost: four passes over the faces, one over the vertices.

#include <Eigen/Core>
#include <array>
#include <cstdint>

#include "estimator/messages/local_mesh.hpp"
#include "mesher/plane_facts.hpp"
#include "mesher/plane_votes.hpp"

namespace swiftlet {

/// A vertex counts as a plane's up to here, whatever its noise.
inline constexpr float kPlaneGate = 0.05F;  // m
/// What a wall leaves of a plane: posters, skirtings, mats, plaster (1 sigma).
inline constexpr float kSurfaceSigma = 0.008F;  // m

/// A plane's claim in one keyframe.
struct PlaneSupport {
  int points = 0;
  int known = 0;     ///< of them, known to half of the gate: the others would be in it on a bent surface too
  float area = 0;    ///< m^2 of its faces
  float narrow = 0;  ///< m, standard deviation of its points along the narrower direction in the plane
  float rms = 0;     ///< m, of its points' distances
  float turn_sigma = 0;   ///< rad, 1 sigma of a vertical plane's azimuth; 0 of a horizontal one
  float chi_squared = 0;  ///< mean of the squared distances in sigmas
  /// Of the well-known vertices in a slab around it and within its extent, those that are on it.
  float share = 0;
  Eigen::Vector3f centre = Eigen::Vector3f::Zero();  ///< m, from the viewer
};

/// m, 1 sigma of a vertex along a normal.
float normalSigma(const VertexFacts& vertex, const Eigen::Vector3f& normal);

class PlaneFit {
 public:
  /// Moves the guess to where its vertices are. `known`: from an earlier keyframe, not from votes, and near
  /// already. False without enough vertices.
  [[nodiscard]] bool refine(const LocalMesh& mesh, const MeshFacts& facts, PlaneGuess& plane, bool known);
  /// After refine(): of the plane that it gave.
  [[nodiscard]] const PlaneSupport& support() const { return support_; }
  /// m, as `narrow`, of one side alone where the points fall apart into two: what happens to lie in one
  /// plane, the front of a column and the edge of a shelf beyond, is far apart and says nothing of what is
  /// between.
  [[nodiscard]] float narrowOfLargerPart(const MeshFacts& facts);
  /// Face f lies in it, and is no other plane's.
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
  std::array<float, kMaxMeshVertices> places_{};  // along it
};

}  // namespace swiftlet
