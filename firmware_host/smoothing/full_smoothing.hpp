#pragma once
// Full smoothing of a run from its keyframes.swk, at the end of `replay` or later by `swiftlet smooth`.
//
// Off the flight path: allocates and takes unbounded time. Memory is limited by
// FullSmoothingOptions::most_bytes; the need is known before the solve begins. InputError for a file that
// cannot be read.

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
  std::size_t most_bytes = 0;               ///< memory limit; a run that needs more is refused
  const std::atomic<bool>* stop = nullptr;  ///< set: end at once without a result
  /// Called before the solve begins, with the number of keyframes and the memory needed in bytes.
  std::function<void(std::size_t, std::size_t)> begins;
};

struct FullSmoothing {
  std::vector<MapPose> poses;  ///< of the keyframes; empty: see `problem`
  FullSmootherReport report;   ///< only if there are poses
  std::size_t keyframes = 0;   ///< in the file
  Spent spent;
  FaultCounts faults;   ///< refused loops
  std::string cut;      ///< where the file was cut off, as text; empty: it was complete
  std::string problem;  ///< why there are no poses, with the remedy; empty: there are some
};

FullSmoothing smoothKeyframes(const std::string& path, const FullSmoothingOptions& options);

}  // namespace swiftlet
