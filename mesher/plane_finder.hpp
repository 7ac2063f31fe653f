#pragma once
// Finds floors, tables, ceilings and walls in the local mesh and follows them over keyframes. The smoother
// ties landmarks to these planes, and meshes are flattened onto them.
//
// At each keyframe known planes are fitted again to their faces. The remaining faces vote for new planes
// (plane_votes.hpp), which are fitted (plane_fit.hpp), merged with known ones if they match, and otherwise
// followed until several keyframes agree. Only then is a plane reported: it needs enough area, points and
// extent in two directions, residuals that the points' noise explains, and a high share of the points around
// it on it. A cluttered corner may meet some of these conditions, but not all of them at several keyframes. A
// landmark is on a plane if it is within the gate (in sigmas and absolute) and a corner of faces in the
// plane, at two keyframes; it is dropped when it is beyond a wider gate. Frames: the mesh's world, z up;
// metres. A new epoch starts anew. Memory: 0.5 MiB, reserved by the constructor; no allocation afterwards.
// Cost: linear in faces times planes; 0.5 ms with the 400 faces of a window. Source: Rosinol, Sattler,
// Pollefeys, Carlone, "Incremental Visual-Inertial 3D Mesh Generation with Structural Regularities", ICRA
// 2019, section III-B; the tests against false planes are this project's own.

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "estimator/core/fixed_vector.hpp"
#include "estimator/core/status.hpp"
#include "estimator/messages/local_mesh.hpp"
#include "estimator/messages/plane_report.hpp"
#include "estimator/messages/smoothed_window.hpp"
#include "mesher/plane_facts.hpp"
#include "mesher/plane_fit.hpp"
#include "mesher/plane_votes.hpp"

namespace swiftlet {

struct PlaneCounters {
  std::uint64_t keyframes = 0;
  std::uint64_t refused = 0;    ///< vertices and faces that are not finite or have invalid indices
  std::uint64_t confirmed = 0;  ///< planes reported so far
  std::uint64_t merged = 0;
  std::uint64_t expired = 0;
  std::uint64_t points_dropped = 0;  ///< landmarks that were on a plane and later disagreed with it
};

class PlaneFinder {
 public:
  PlaneFinder() = default;

  /// `mesh`: of a keyframe. `window`: of the same keyframe, for the sigmas of its landmarks and its newest
  /// pose as the viewer. Overwrites `report`. kInvalidInput if the window's newest pose is not finite or of
  /// another epoch: `report` is then empty, and nothing else changes except for the counter of refused input.
  Status step(const LocalMesh& mesh, const SmoothedWindow& window, PlaneReport& report);

  [[nodiscard]] const PlaneCounters& counters() const { return counters_; }
  /// Forgets all planes; ids continue.
  void reset();

 private:
  /// More than are reported, because planes are followed first.
  static constexpr std::size_t kMaxFollowed = 2 * kMaxPlanes;
  static constexpr std::uint8_t kNone = 255;

  struct Followed {
    std::uint64_t id = 0;
    PlaneDirection direction = PlaneDirection::kHorizontal;
    Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();
    double distance = 0;                               // world
    Eigen::Vector3d centre = Eigen::Vector3d::Zero();  // of its points when last seen, world
    double turn_variance = 0;                          // rad^2, of a wall's azimuth
    int supported = 0;                                 // keyframes with support
    int silent = 0;                                    // keyframes since the last support
    bool reported = false;
    int points = 0;  // at this keyframe
  };
  struct Association {
    TrackId id = 0;
    std::uint64_t plane = 0;
    int agreed = 0;   // keyframes at which it agreed with the plane
    int without = 0;  // consecutive keyframes without a face of the plane
    float sigma = 0;  // m, of its depth, at this keyframe
    bool firm = true;
  };
  struct Owner {
    std::uint8_t plane = kNone;    // index in followed_
    std::uint8_t faces = 0;        // around the vertex
    std::uint8_t plane_faces = 0;  // of these, in some plane
  };
  [[nodiscard]] static bool isProven(const Followed& plane);
  [[nodiscard]] bool provesItself();
  void followKnown(const LocalMesh& mesh);
  void findNew(const LocalMesh& mesh);
  [[nodiscard]] bool blend(const Followed& plane, PlaneGuess& guess, double& turn_variance) const;
  void accept(const LocalMesh& mesh, const PlaneGuess& guess, std::size_t index, bool voted);
  [[nodiscard]] std::size_t slotFor(const PlaneGuess& guess);
  void mergeDuplicates();
  void expire();
  [[nodiscard]] bool forgetOne();
  void remove(std::size_t index);
  void associate(const LocalMesh& mesh);
  [[nodiscard]] bool associateVertex(std::size_t vertex, Association& association);
  void write(const LocalMesh& mesh, PlaneReport& report);
  void spreadOver(const LocalMesh& mesh);
  [[nodiscard]] Followed* find(std::uint64_t id);
  [[nodiscard]] float heightOf(const Followed& plane, const VertexFacts& vertex) const;

  MeshFacts facts_;
  PlaneVotes votes_;
  PlaneFit fit_;
  FixedVector<Followed, kMaxFollowed> followed_;  // longest followed first
  std::array<Owner, kMaxMeshVertices> owners_{};
  FixedVector<Association, kMaxMeshVertices> associations_;  // by id, each once
  FixedVector<Association, kMaxMeshVertices> associations_before_;
  std::uint64_t next_id_ = 1;
  std::uint32_t epoch_ = 0;
  PlaneCounters counters_;
};

}  // namespace swiftlet
