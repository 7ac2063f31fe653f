#pragma once
// Wall and CPU time of the stages, frames and keyframes apart. Clocks live here, on the host's side:
// stages read none.

#include <array>
#include <string_view>

#include "firmware_host/realtime/latency_histogram.hpp"

namespace swiftlet {

enum class StageId : std::size_t {
  kSource,          ///< reading and decoding an image
  kPairing,         ///< a look at the images that have come
  kImu,             ///< sample to state: wall from its arrival until the state is published
  kFix,             ///< propagation starts again from a new fix
  kTrack,           ///< front-end
  kSmooth,          ///< back-end until the state stands
  kTrim,            ///< making room in the window, after the state was published
  kMesh,            ///< frame mesh, at keyframes the mesh over the horizon too
  kLoop,            ///< loop closure, of a keyframe
  kDepth,           ///< the map's parts, of a mapped frame: depth,
  kVolume,          ///< fusion of it,
  kSurface,         ///< surface of the blocks that changed,
  kDistance,        ///< distance field
  kCorrection,      ///< what moved, fused again
  kImageToPose,     ///< wall from the image's arrival until the pose is published; CPU of track and smooth
  kExposureToPose,  ///< wall from the middle of the exposure
  kMap,             ///< full smoothing
  kCount
};

/// In snake case: "source", "image_to_pose", ...
std::string_view stageName(StageId stage);

/// Wall time is the latency for a reader. CPU time is the stage's own time, independent of other load.
struct StageTimes {
  LatencyHistogram wall_frames;  ///< frames that are no keyframes, and what belongs to no frame
  LatencyHistogram wall_keyframes;
  LatencyHistogram cpu_frames;  ///< of this thread
  LatencyHistogram cpu_keyframes;
};

using StageTable = std::array<StageTimes, static_cast<std::size_t>(StageId::kCount)>;

double wallSeconds();        ///< monotonic
double threadCpuSeconds();   ///< this thread
double processCpuSeconds();  ///< all threads

/// What one call took.
struct Spent {
  double wall = 0;
  double cpu = 0;
  Spent& operator+=(const Spent& other) {
    wall += other.wall;
    cpu += other.cpu;
    return *this;
  }
};

/// Runs `work` and measures it.
template <typename Work>
Spent measured(Work&& work) {
  const double wall = wallSeconds();
  const double cpu = threadCpuSeconds();
  work();
  return {wallSeconds() - wall, threadCpuSeconds() - cpu};
}

void addTime(StageTable& table, StageId stage, const Spent& spent, bool keyframe = false);

}  // namespace swiftlet
