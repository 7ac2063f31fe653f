#pragma once
// Full smoothing of a run from its keyframes.swk: what `replay` does at its end and `swiftlet smooth` later.
//
// Off the flight path: allocates without bound of time, memory below FullSmoothingOptions::most_bytes, which
// is known before the solve begins. InputError for a file that cannot be read.

#include <atomic>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "estimator/smoother/full_smoother.hpp"
#include "firmware_host/interfaces/fault_counts.hpp"
#include "firmware_host/realtime/stage_timer.hpp"

namespace swiftlet {

struct MapPose {
  Stamp stamp;
  SE3 T_world_body;
};

struct FullSmoothingOptions {
  std::size_t most_bytes = 0;               ///< of memory; a run that needs more is refused
  const std::atomic<bool>* stop = nullptr;  ///< set: end at once, without a result
  /// Told what the solve will take before it begins: keyframes and bytes.
  std::function<void(std::size_t, std::size_t)> begins;
};

struct FullSmoothing {
  std::vector<MapPose> poses;  ///< of the keyframes; empty: see `problem`
  FullSmootherReport report;   ///< where there are poses
  Spent spent;
  FaultCounts faults;   ///< keyframes and loops that were refused
  std::string cut;      ///< where the file ended too early, in words; empty: in order
  std::string problem;  ///< why there are no poses, with the remedy; empty: there are
};

FullSmoothing smoothKeyframes(const std::string& path, const FullSmoothingOptions& options);

}  // namespace swiftlet
