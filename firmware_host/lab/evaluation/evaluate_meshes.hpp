#pragma once
// Compares the meshes of a run folder with the true surface of its log.

#include <string>

#include "firmware_host/lab/evaluation/accuracy.hpp"
#include "firmware_host/lab/evaluation/mesh_accuracy.hpp"

namespace swiftlet {

struct MeshEvaluationRequest {
  std::string run;         ///< folder with meshes/frames.csv, complete_mesh.ply or local_mesh.ply
  std::string log;         ///< gives the cameras; its truth/ holds mesh.ply and observed.ply
  std::string truth_mesh;  ///< replaces the log's truth/mesh.ply; observed.ply is searched for beside it
};

/// `estimate`: the run's trajectory, `truth`: the log's. Meshes are moved by the alignment of the estimate to
/// the truth. map.ply is moved by that of the poses in its own frame: in_map.tum of a run that was located in
/// a kept map, else map.tum of a run with loop closure, else the estimate. If the path is too short or
/// straight to align positions, the pose in the middle is used; without a pair of poses the meshes are not
/// moved, and MeshAccuracy::alignment says so. Frames outside the section of `options` or without a true pose
/// are omitted. Without a true surface, only the share of the hull drawn by the meshes of a sequence is
/// evaluated. InputError if there is nothing to evaluate or to compare with.
MeshAccuracy evaluateMeshes(const MeshEvaluationRequest& request, const Trajectory& estimate,
                            const Trajectory& truth, const AccuracyOptions& options);

}  // namespace swiftlet
