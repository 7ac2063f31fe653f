#pragma once
// The mesh over the smoother's horizon: frame meshes fused as landmarks and triplets of landmarks.
//
// A vertex is a landmark at its position in the newest window. It is removed with its landmark (never with
// `keep_all`, the complete mesh of a flight), or if no face uses it. A face is removed if one of its vertices
// is, if a newer frame that sees all three vertices triangulates them differently or finds the face torn, if
// a landmark is seen through it, or if its longest edge has grown by half. Frames: world, metres. Sources:
// Rosinol et al., ICRA 2019 (vertices and triplets); Lovi, Birkbeck, Cobzas, Jagersand, "Incremental
// Free-Space Carving for Real-Time 3D Reconstruction", 3DPVT 2010 (landmarks seen through faces). Memory: 300
// bytes per vertex of the capacity, reserved by the constructor. Full: new vertices and faces are refused and
// counted. Cost: faces that are not tracked completely times points of the frame; 0.5 ms for a window.

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
  bool keep_all = false;  ///< keep vertices whose landmarks have left the window
};

struct HorizonCounters {
  std::uint64_t refused = 0;  ///< vertices and faces refused for lack of room
  std::uint64_t refuted = 0;  ///< faces removed because a landmark was seen through them
  std::uint64_t replaced =
      0;  ///< faces removed because a newer frame joined their vertices differently or tore them
};

class HorizonMesh {
 public:
  struct Face {
    std::array<std::uint32_t, 3> vertex{};
    std::uint8_t label = kNoLabel;
    std::uint8_t votes = 0;  ///< observations of the label minus those of others
    float edge = 0;          ///< m, longest edge when the face was first seen
  };

  explicit HorizonMesh(const HorizonLimits& limits);

  /// Adds a frame, seen by `camera` from T_world_cam, and updates the landmarks' positions.
  void update(const FrameMesh& frame, const LandmarkLookup& landmarks, const CameraModel& camera,
              const SE3& T_world_cam);
  void clear();

  /// Ordered by id.
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
  TripletTable known_;                    ///< index of faces_ by their vertices
  std::vector<std::uint32_t> new_index_;  ///< of each old vertex
  std::vector<std::uint8_t> referenced_;  ///< of each vertex: 1 if a face uses it
  std::vector<Projected> projected_;
  // Data of the current frame.
  TripletTable joined_;  ///< all its triangles, kept or not, by their points
  FixedVector<std::uint16_t, kMaxFeatures> by_id_;
  std::array<bool, kMaxFeatures> in_kept_face_{};
  std::array<std::uint32_t, kMaxFeatures> vertex_of_{};
  std::vector<std::uint32_t> point_of_;  ///< of each vertex
  HorizonCounters counters_;
};

}  // namespace swiftlet
