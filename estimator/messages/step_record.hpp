#pragma once
// The inputs that each stage used for a step, so that a threaded run, in which timing decides what a stage
// sees, can be repeated.
//
// Numbers count from 1 in the order of arrival at the estimator; 0 is none. IMU samples and the images of
// each camera are numbered over the run, windows and fixes in the order in which `smooth` published them,
// plane reports in that of `mesh`, corrections in that of `loop`.

#include <array>
#include <cstdint>

#include "estimator/core/limits.hpp"
#include "estimator/core/stamp.hpp"
#include "estimator/messages/effort.hpp"

namespace swiftlet {

/// Propagation restarted from a fix.
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
  std::uint64_t window = 0;                        ///< number of the window used for prediction
  Effort effort;

  bool operator==(const TrackStep&) const = default;
};

struct SmoothStep {
  std::uint64_t frame = 0;    ///< index of the tracked frame
  std::uint64_t samples = 0;  ///< number of the newest IMU sample taken before it
  Effort effort;
  std::uint64_t planes = 0;  ///< number of the newest plane report

  bool operator==(const SmoothStep&) const = default;
};

struct MeshStep {
  std::uint64_t frame = 0;   ///< index of the tracked frame
  std::uint64_t window = 0;  ///< number of the newest window
  std::uint64_t image = 0;   ///< number of camera 0's image; 0: not available

  bool operator==(const MeshStep&) const = default;
};

/// A keyframe used by loop closure; those in between were skipped.
struct LoopStep {
  std::uint64_t frame = 0;                         ///< index of the tracked frame
  std::uint64_t window = 0;                        ///< number of its window
  std::array<std::uint64_t, kMaxCameras> image{};  ///< number of each camera's image; 0: none was at hand

  bool operator==(const LoopStep&) const = default;
};

/// A frame used by the map, and the spare-time work done since the frame before. The last step of a run has
/// `end` instead of a frame: the work after the last frame.
struct MapStep {
  std::uint64_t frame = 0;                         ///< StereoFrame::index; not valid if `end`
  std::uint64_t correction = 0;                    ///< number of the newest correction used; 0: none
  std::uint64_t spare_turns = 0;                   ///< pieces of spare-time work before it
  std::array<std::uint64_t, kMaxCameras> image{};  ///< number of each camera's image; 0: none was at hand
  bool end = false;

  bool operator==(const MapStep&) const = default;
};

}  // namespace swiftlet
