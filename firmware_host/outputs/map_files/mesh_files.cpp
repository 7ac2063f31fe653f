#include "firmware_host/outputs/map_files/mesh_files.hpp"

#include <fmt/format.h>

#include <filesystem>

#include "drivers/input/input_error.hpp"
#include "firmware_host/files/run_claim.hpp"
#include "firmware_host/outputs/map_files/ply_file.hpp"

namespace swiftlet {
namespace {

/// Recreates the folder for the meshes and returns its path.
std::string madeAnew(const std::string& run_folder) {
  const std::filesystem::path folder = std::filesystem::path(run_folder) / "meshes";
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) {
    throw InputError(folder.string(), 0, "", "cannot be created: " + error.message(),
                     "Give another folder with --out");
  }
  removeMeshes(folder.string());
  return folder.string();
}

}  // namespace

TriangleMesh toTriangleMesh(const LocalMesh& mesh) {
  TriangleMesh out;
  out.vertices.reserve(mesh.vertices.size());
  out.grey.reserve(mesh.vertices.size());
  out.faces.reserve(mesh.faces.size());
  out.labels.reserve(mesh.faces.size());
  for (const MeshVertex& vertex : mesh.vertices) {
    out.vertices.push_back(vertex.p_world);
    out.grey.push_back(vertex.grey);
  }
  for (const MeshFace& face : mesh.faces) {
    out.faces.push_back(face.vertex);
    out.labels.push_back(face.label);
  }
  return out;
}

MeshSequenceWriter::MeshSequenceWriter(const std::string& run_folder)
    : folder_(madeAnew(run_folder)), list_(folder_ + "/frames.csv") {
  list_.write("frame,stamp [ns],keyframe,frame_mesh,horizon_mesh,hull [px: u v ...]");
}

std::string MeshSequenceWriter::writeFile(const char* kind, std::uint64_t frame,
                                          const LocalMesh& mesh) const {
  if (mesh.faces.empty()) return {};
  std::string name = fmt::format("{}_{:06}.ply", kind, frame);
  // Not synced: two waits for the disk per frame would hold up the writing thread.
  writePly(folder_ + "/" + name, toTriangleMesh(mesh), WholeFile::Sync::kNo);
  return name;
}

void MeshSequenceWriter::write(bool keyframe, const LocalMesh& frame, const LocalMesh* horizon,
                               std::span<const Eigen::Vector2f> hull) {
  std::string corners;
  for (const Eigen::Vector2f& corner : hull) {
    corners += fmt::format("{}{:.3f} {:.3f}", corners.empty() ? "" : " ", corner.x(), corner.y());
  }
  const std::string frame_file = writeFile("frame", frame.frame_index, frame);
  const std::string horizon_file =
      horizon == nullptr ? "" : writeFile("horizon", frame.frame_index, *horizon);
  list_.write(fmt::format("{},{},{},{},{},{}", frame.frame_index, frame.stamp.ns, keyframe ? 1 : 0,
                          frame_file, horizon_file, corners));
}

}  // namespace swiftlet
