#pragma once
// Runs only the mesher on a log with given poses: called by `swiftlet mesh` and its tests.
//
// Images are paired and tracked as in flight (the front-end predicts from the given poses), landmarks are
// triangulated with the given poses (GivenPoseWindow), and MeshStage runs once per frame. Frames without a
// pose are skipped and counted. Where the trajectory jumps, a new epoch with a new mesh begins.

#include <nlohmann/json.hpp>
#include <string>

#include "firmware_host/lab/modules/posed_log.hpp"

namespace swiftlet {

struct MeshRequest : PosedLogRequest {
  std::string out;        ///< folder to write
  bool complete = false;  ///< also the mesh over the whole flight
};

struct MeshRunResult {
  nlohmann::ordered_json summary;  ///< as written to summary.json
  bool finished = true;            ///< false: stopped
  bool has_mesh = false;           ///< at least one frame had a face
};

/// Writes meshes/, local_mesh.ply, trajectory.tum (the poses used), summary.json and, on request,
/// complete_mesh.ply. InputError for bad input; nothing is written before the first frame with a pose.
MeshRunResult runMesh(const MeshRequest& request, const Settings& settings);

}  // namespace swiftlet
