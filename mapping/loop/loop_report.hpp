#pragma once
// The output of loop closure: the fate of each candidate, and the pose of the odometry's world in the map.

#include <array>
#include <cstdint>

#include "estimator/core/fixed_vector.hpp"
#include "estimator/core/stamp.hpp"
#include "estimator/geometry/se3.hpp"
#include "mapping/loop/loop_map_counters.hpp"
#include "mapping/place/loop_verification.hpp"

namespace swiftlet {

/// Two keyframes that may show the same place, and the result of their verification.
struct LoopCandidate {
  std::uint64_t old_frame = 0;  ///< index of the keyframe seen again
  Stamp old_stamp;
  std::uint64_t new_frame = 0;  ///< the newest keyframe; an earlier one is possible if `near`
  Stamp new_stamp;
  bool kept = false;  ///< the old one is of a kept map, so of another flight and clock
  bool near = false;  ///< found by position in the map, not by words
  LoopFate fate = LoopFate::kInvalidInput;
  std::size_t matches = 0;
  std::size_t inliers = 0;
  double similarity = 0;  ///< of the words, relative to that of successive keyframes; 0 if `near`
};

/// Largest number of candidates verified in one step.
inline constexpr std::size_t kMaxLoopCandidates = 4;

/// Largest number of epochs reported as tied to one epoch.
inline constexpr std::size_t kTiedEpochs = 16;

/// Pose of the newest epoch's world in the map.
struct MapCorrection {
  std::uint32_t epoch = 0;
  bool kept_map = false;      ///< a kept map was loaded
  bool located = false;       ///< loops join the newest node to the kept map, whose frame is the map frame
  std::uint64_t version = 0;  ///< incremented by every keyframe
  SE3 T_map_world;
};

struct LoopReport {
  Stamp stamp;
  std::uint64_t frame = 0;
  FixedVector<LoopCandidate, kMaxLoopCandidates> candidates;
  std::uint32_t loops = 0;     ///< verified loops held now
  std::uint32_t selected = 0;  ///< accepted loops among them
  bool moved = false;          ///< the map moved in this step
  MapCorrection correction;
};

struct LoopCounters {
  std::uint64_t keyframes = 0;
  std::uint64_t nodes = 0;                        ///< keyframes that became poses of the graph
  std::uint64_t without_image = 0;                ///< nodes without a place
  std::uint64_t gaps = 0;                         ///< links bridged over missed keyframes
  std::uint64_t components = 0;                   ///< pieces that the odometry alone holds together
  std::array<std::uint64_t, kLoopFates> fates{};  ///< of candidates
  std::uint64_t near = 0;                         ///< candidates found by position in the map
  std::uint64_t loops = 0;                        ///< verified loops
  std::uint64_t near_loops = 0;                   ///< verified loops from near candidates
  std::uint64_t selected = 0;                     ///< loops accepted at the end
  std::uint64_t kept_loops = 0;                   ///< verified loops that lead into a kept map
  std::uint64_t refused = 0;                      ///< keyframes that the map refused
  LoopMapCounters map;                            ///< nodes and loops removed for room, work of the graph
};

}  // namespace swiftlet
