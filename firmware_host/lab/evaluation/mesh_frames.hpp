#pragma once
// meshes/frames.csv of a run folder: which mesh files belong to which frame, and the hull of its features.
//
// Header `frame,stamp [ns],keyframe,frame_mesh,horizon_mesh,hull [px: u v ...]`; file names within the
// folder, empty if there is none; the hull is a convex polygon in camera 0's raw pixels, its numbers
// separated by blanks, empty if a frame had none.

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "estimator/core/stamp.hpp"

namespace swiftlet {

struct MeshFrame {
  std::int64_t frame = 0;
  Stamp stamp;
  bool keyframe = false;
  std::string frame_mesh;    ///< path; empty: none
  std::string horizon_mesh;  ///< path; empty: none
  std::vector<Eigen::Vector2f> hull;
};

/// InputError naming the line of the first bad row, because the file is written by a program.
std::vector<MeshFrame> readMeshFrames(const std::string& folder);

}  // namespace swiftlet
