#pragma once
// The mesh over the smoother's horizon: frame meshes fused as landmarks and triplets of them.
//
// A vertex is a landmark; its place is the newest window's, always. It leaves with its landmark (or never:
// `keep_all`, the complete mesh of a flight), or when no face has it. A face stays until one of its vertices
// leaves, until a newer frame that sees all three joins them otherwise, until a landmark is seen through it,
// or until its longest edge has grown by half. Frames: world, metres. Sources: Rosinol et al.,
// ICRA 2019 (vertices and triplets); Lovi, Birkbeck, Cobzas, Jagersand, "Incremental Free-Space Carving for
// Real-Time 3D Reconstruction", 3DPVT 2010 (what is seen through). Memory: 300 bytes a vertex of the
// capacity, all reserved by the constructor. Full: new vertices and faces are refused and counted. Cost:
// faces not wholly tracked times the frame's points; 0.5 ms for a window's worth.

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "estimator/camera/camera_model.hpp"
#include "estimator/geometry/se3.hpp"
#include "estimator/messages/local_mesh.hpp"
#include "mesher/frame_mesh.hpp"
#include "mesher/landmark_lookup.hpp"
#include "mesher/triplet_table.hpp"

namespace swiftlet {

struct HorizonLimits {
  std::size_t vertices = kMaxMeshVertices;
  std::size_t faces = kMaxMeshFaces;
  bool keep_all = false;  ///< vertices stay when their landmarks leave the window
};

struct HorizonCounters {
  std::uint64_t refused = 0;   ///< vertices and faces, for want of room
  std::uint64_t refuted = 0;   ///< faces through which a landmark was seen
  std::uint64_t replaced = 0;  ///< faces whose vertices a newer frame joined otherwise
};

class HorizonMesh {
 public:
  struct Face {
    std::array<std::uint32_t, 3> vertex{};
    std::uint8_t label = kNoLabel;
    std::uint8_t votes = 0;  ///< sightings of the label less those of others
    float edge = 0;          ///< m, its longest when it was first seen
  };

  explicit HorizonMesh(const HorizonLimits& limits);

  /// Takes in a frame, seen by `camera` from T_world_cam, and the landmarks' newest places.
  void update(const FrameMesh& frame, const LandmarkLookup& landmarks, const CameraModel& camera,
              const SE3& T_world_cam);
  void clear();

  /// In order of their ids.
  [[nodiscard]] std::span<const MeshVertex> vertices() const { return vertices_; }
  [[nodiscard]] std::span<const Face> faces() const { return faces_; }
  [[nodiscard]] const HorizonCounters& counters() const { return counters_; }

 private:
  /// A vertex in the frame's camera.
  struct Projected {
    Eigen::Vector2f pixel;
    float inverse_distance = 0;  ///< 1/m; 0: it does not project
  };

  void mergeVertices(const FrameMesh& frame, const LandmarkLookup& landmarks);
  void renumberFaces();
  void joinFrame(const FrameMesh& frame);
  void project(const CameraModel& camera, const SE3& T_cam_world);
  void review(const FrameMesh& frame);
  void addFaces(const FrameMesh& frame);
  [[nodiscard]] bool seenThrough(const Face& face, const FrameMesh& frame) const;
  [[nodiscard]] float longestEdge(const Face& face) const;

  HorizonLimits limits_;
  std::vector<MeshVertex> vertices_, merged_;
  std::vector<Face> faces_;
  TripletTable known_;                    ///< faces_ by their vertices
  std::vector<std::uint32_t> new_index_;  ///< of the old vertices
  std::vector<std::uint8_t> referenced_;  ///< the vertex is a face's
  std::vector<Projected> projected_;
  // The frame's points.
  TripletTable joined_;  ///< its triangles, kept or not, by their points
  FixedVector<std::uint16_t, kMaxFeatures> by_id_;
  std::array<bool, kMaxFeatures> in_kept_face_{};
  std::array<std::uint32_t, kMaxFeatures> vertex_of_{};
  std::vector<std::uint32_t> point_of_;  ///< of each vertex
  HorizonCounters counters_;
};

}  // namespace swiftlet
