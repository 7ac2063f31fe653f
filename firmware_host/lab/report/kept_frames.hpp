#pragma once
// What a run folder keeps of single images: the features of keyframes and the matches of loops
// (keyframes.swk), the meshes of frames (meshes/). Files that a run does not have are no fault.
//
// Memory: 28 bytes a feature; meshes are read when they are asked for.

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "estimator/camera/rig.hpp"
#include "estimator/core/stamp.hpp"
#include "estimator/messages/loop_revisit.hpp"
#include "estimator/messages/tracked_frame.hpp"
#include "firmware_host/lab/evaluation/mesh_frames.hpp"
#include "firmware_host/lab/report/run_files.hpp"
#include "firmware_host/outputs/map_files/triangle_mesh.hpp"

namespace swiftlet {

struct KeptKeyframe {
  Stamp stamp;                           ///< of its image
  std::vector<TrackedFeature> features;  ///< by rising id
};

struct KeptFrames {
  std::optional<Rig> rig;  ///< of the keyframes; empty: no keyframes.swk
  std::vector<KeptKeyframe> keyframes;
  std::vector<LoopRevisit> loops;
  std::vector<MeshFrame> meshes;

  /// Null where the image was no keyframe.
  [[nodiscard]] const KeptKeyframe* keyframeAt(Stamp stamp) const;
  /// Of a loop closure found at this image; null: none.
  [[nodiscard]] const LoopRevisit* loopAt(Stamp stamp) const;
  /// The mesh of this image; empty: none was written. InputError where it is damaged.
  [[nodiscard]] std::optional<TriangleMesh> meshAt(Stamp stamp) const;
};

/// What is damaged is noted in `missing`, and the rest taken.
KeptFrames readKeptFrames(const std::string& run_folder, std::vector<MissingFile>& missing);

}  // namespace swiftlet
