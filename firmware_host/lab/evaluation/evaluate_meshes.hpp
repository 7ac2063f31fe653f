#pragma once
// The meshes of a run folder against the true surface of its log.

#include <string>

#include "firmware_host/lab/evaluation/accuracy.hpp"
#include "firmware_host/lab/evaluation/mesh_accuracy.hpp"

namespace swiftlet {

struct MeshEvaluationRequest {
  std::string run;         ///< folder with meshes/frames.csv, complete_mesh.ply or local_mesh.ply
  std::string log;         ///< says the cameras; its truth/ holds mesh.ply and observed.ply
  std::string truth_mesh;  ///< in place of the log's truth/mesh.ply; observed.ply is looked for beside it
  Trajectory in_map = {};  ///< of a run that was located in a kept map: map.ply lies in that one's frame
};

/// `estimate` is the run's trajectory, `truth` the log's; meshes are moved as the fit of the one onto the
/// other says. Where the path is too short or straight for a fit of positions, by the pose in the middle;
/// without a pair of poses they are judged where they are, and MeshAccuracy::alignment says so. Frames
/// outside the section of `options` or without a true pose are left out. Without a true surface only the
/// share of the hull that the meshes of a sequence draw is judged. InputError when there is nothing to judge
/// or to judge by.
MeshAccuracy evaluateMeshes(const MeshEvaluationRequest& request, const Trajectory& estimate,
                            const Trajectory& truth, const AccuracyOptions& options);

}  // namespace swiftlet
