#pragma once
// Wall and CPU time of the stages, separately for frames and keyframes. The clocks are here on the host's
// side: stages read none.

#include <array>
#include <string_view>

#include "firmware_host/realtime/latency_histogram.hpp"

namespace swiftlet {

enum class StageId : std::size_t {
  kSource,          ///< reading and decoding an image
  kPairing,         ///< checking for newly arrived images
  kImu,             ///< sample to state: wall time from its arrival to the publication of the state
  kFix,             ///< restart of propagation from a new fix
  kTrack,           ///< front-end
  kSmooth,          ///< back-end until the state is estimated
  kTrim,            ///< making room in the window after the state was published
  kMesh,            ///< frame mesh; at keyframes also the mesh over the horizon
  kLoop,            ///< loop closure of a keyframe
  kDepth,           ///< map, per mapped frame: depth image
  kVolume,          ///< fusion of depth
  kSurface,         ///< surface of changed blocks
  kDistance,        ///< distance field
  kCorrection,      ///< fusing again what loop closure moved
  kImageToPose,     ///< wall: image's arrival to published pose; CPU: track and smooth
  kExposureToPose,  ///< wall time from mid-exposure to the publication of the pose
  kMap,             ///< full smoothing
  kCount
};

/// In snake case: "source", "image_to_pose", ...
std::string_view stageName(StageId stage);

/// Wall time is what a reader waits. CPU time is the stage's own, independent of other load.
struct StageTimes {
  LatencyHistogram wall_frames;  ///< frames that are not keyframes, and work that belongs to no frame
  LatencyHistogram wall_keyframes;
  LatencyHistogram cpu_frames;  ///< CPU time of this thread
  LatencyHistogram cpu_keyframes;
};

using StageTable = std::array<StageTimes, static_cast<std::size_t>(StageId::kCount)>;

double wallSeconds();        ///< monotonic
double threadCpuSeconds();   ///< this thread
double processCpuSeconds();  ///< all threads

/// Duration of one call.
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
