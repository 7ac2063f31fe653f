#pragma once
// What each stage took for a step, beside the messages themselves: enough to repeat a threaded run, in
// which threads decide by their speed what a stage sees.
//
// Numbers count from 1 in the order of arrival at the estimator, 0 is none: IMU samples over the run,
// images over the run of each camera, windows and fixes in the order in which `smooth` published them, plane
// reports in the order in which `mesh` did, corrections in the order in which `loop` did.

#include <array>
#include <cstdint>

#include "estimator/core/limits.hpp"
#include "estimator/core/stamp.hpp"
#include "estimator/messages/effort.hpp"

namespace swiftlet {

/// Propagation started again from a fix.
struct PropagateStep {
  std::uint64_t samples = 0;  ///< number of the newest IMU sample taken before
  std::uint64_t fix = 0;      ///< number of the fix

  bool operator==(const PropagateStep&) const = default;
};

struct TrackStep {
  std::uint64_t frame = 0;  ///< StereoFrame::index
  Stamp stamp;
  std::array<std::uint64_t, kMaxCameras> image{};  ///< number of each camera's image; 0: missing
  std::uint64_t samples = 0;                       ///< number of the newest IMU sample taken before it
  std::uint64_t window = 0;                        ///< number of the window that it predicted from
  Effort effort;

  bool operator==(const TrackStep&) const = default;
};

struct SmoothStep {
  std::uint64_t frame = 0;    ///< index of the tracked frame
  std::uint64_t samples = 0;  ///< number of the newest IMU sample taken before it
  Effort effort;
  std::uint64_t planes = 0;  ///< number of the plane report that was the newest

  bool operator==(const SmoothStep&) const = default;
};

struct MeshStep {
  std::uint64_t frame = 0;   ///< index of the tracked frame
  std::uint64_t window = 0;  ///< number of the window that was the newest
  std::uint64_t image = 0;   ///< number of camera 0's image; 0: none was at hand

  bool operator==(const MeshStep&) const = default;
};

/// A keyframe that loop closure took; those in between were skipped.
struct LoopStep {
  std::uint64_t frame = 0;                         ///< index of the tracked frame
  std::uint64_t window = 0;                        ///< number of the window that came with it
  std::array<std::uint64_t, kMaxCameras> image{};  ///< number of each camera's image; 0: none was at hand

  bool operator==(const LoopStep&) const = default;
};

/// A frame that the map took, and how much spare-time work it did since the frame before. The last step of a
/// run has `end` instead of a frame: what the map did after its last frame.
struct MapStep {
  std::uint64_t frame = 0;                         ///< StereoFrame::index; meaningless where `end`
  std::uint64_t correction = 0;                    ///< number of the newest correction that it took; 0: none
  std::uint64_t spare_turns = 0;                   ///< pieces of spare-time work before it
  std::array<std::uint64_t, kMaxCameras> image{};  ///< number of each camera's image; 0: none was at hand
  bool end = false;

  bool operator==(const MapStep&) const = default;
};

}  // namespace swiftlet
