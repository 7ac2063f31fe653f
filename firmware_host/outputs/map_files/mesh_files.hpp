#pragma once
// Writes the meshes of a run to its folder: `local_mesh.ply`, and on request every mesh to `meshes/`.
//
// meshes/frames.csv has one row per frame: index, stamp [ns], keyframe (0 or 1), the files of its frame mesh
// and its horizon mesh (in the same folder; empty if there is none or it has no face), and the convex hull of
// the frame's features in raw pixels of camera 0, `u v u v ...`. Files are written by writePly(), in world
// axes. InputError if a file cannot be written.

#include <Eigen/Core>
#include <span>
#include <string>

#include "estimator/messages/local_mesh.hpp"
#include "firmware_host/files/line_file.hpp"
#include "firmware_host/outputs/map_files/triangle_mesh.hpp"

namespace swiftlet {

TriangleMesh toTriangleMesh(const LocalMesh& mesh);

class MeshSequenceWriter {
 public:
  /// Creates `meshes/` in the run folder, removing meshes of an earlier run.
  explicit MeshSequenceWriter(const std::string& run_folder);

  /// `horizon`: null between keyframes.
  void write(bool keyframe, const LocalMesh& frame, const LocalMesh* horizon,
             std::span<const Eigen::Vector2f> hull);

 private:
  [[nodiscard]] std::string writeFile(const char* kind, std::uint64_t frame, const LocalMesh& mesh) const;

  std::string folder_;
  LineFile list_;
};

}  // namespace swiftlet
