#pragma once
// Data of single images in a run folder: features of keyframes and matches of loops (keyframes.swk), meshes
// of frames (meshes/). Missing files are not an error.
//
// Memory: 28 bytes per feature; meshes are read on request.

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
  std::vector<TrackedFeature> features;  ///< ordered by id
};

struct KeptFrames {
  std::optional<Rig> rig;  ///< of the keyframes; empty without keyframes.swk
  std::vector<KeptKeyframe> keyframes;
  std::vector<LoopRevisit> loops;
  std::vector<MeshFrame> meshes;

  /// Null if the image was not a keyframe.
  [[nodiscard]] const KeptKeyframe* keyframeAt(Stamp stamp) const;
  /// The loop found at this image; null: none.
  [[nodiscard]] const LoopRevisit* loopAt(Stamp stamp) const;
  /// The mesh of this image; empty: none was written. InputError if it is damaged.
  [[nodiscard]] std::optional<TriangleMesh> meshAt(Stamp stamp) const;
};

/// Damaged files are noted in `missing`; the rest is read.
KeptFrames readKeptFrames(const std::string& run_folder, std::vector<MissingFile>& missing);

}  // namespace swiftlet
