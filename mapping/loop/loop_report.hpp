#pragma once
// What loop closure tells: each candidate's fate, and how the odometry's world lies in the map.

#include <array>
#include <cstdint>

#include "estimator/core/fixed_vector.hpp"
#include "estimator/core/stamp.hpp"
#include "estimator/geometry/se3.hpp"
#include "mapping/loop/loop_map.hpp"
#include "mapping/place/loop_verification.hpp"

namespace swiftlet {

/// Two keyframes that may show the same place, and what geometry says of them.
struct LoopCandidate {
  std::uint64_t old_frame = 0;  ///< index of the keyframe seen again
  Stamp old_stamp;
  std::uint64_t new_frame = 0;  ///< the newest, or where `near` one before it
  Stamp new_stamp;
  bool kept = false;  ///< the old one is of a kept map: of another flight, and another clock
  bool near = false;  ///< known by where the map has them, not by their words
  LoopFate fate = LoopFate::kInvalidInput;
  std::size_t matches = 0;
  std::size_t inliers = 0;
  double similarity = 0;  ///< of the words, relative to that of neighbouring keyframes; 0 where `near`
};

/// Candidates looked at in one step, at most.
inline constexpr std::size_t kMaxLoopCandidates = 4;

/// Earlier epochs that one is told to be tied to, at most.
inline constexpr std::size_t kTiedEpochs = 16;

/// How the newest epoch's world lies in the map.
struct MapCorrection {
  std::uint32_t epoch = 0;
  bool kept_map = false;  ///< there is a map to be located in
  bool located = false;   ///< in a kept map: loops hold the newest node in it, and the map's frame is its own
  std::uint64_t version = 0;  ///< raised by every keyframe
  SE3 T_map_world;
};

struct LoopReport {
  Stamp stamp;
  std::uint64_t frame = 0;
  FixedVector<LoopCandidate, kMaxLoopCandidates> candidates;
  std::uint32_t loops = 0;     ///< verified so far and kept
  std::uint32_t selected = 0;  ///< of them, those that hold the map together
  bool moved = false;          ///< the map has moved in this step
  MapCorrection correction;
};

struct LoopCounters {
  std::uint64_t keyframes = 0;
  std::uint64_t nodes = 0;          ///< keyframes that were kept as places and poses of the graph
  std::uint64_t without_image = 0;  ///< nodes without a place
  std::uint64_t gaps = 0;           ///< links bridged over keyframes that were missed
  std::uint64_t components = 0;     ///< pieces that odometry alone holds together
  std::array<std::uint64_t, kLoopFates> fates{};  ///< of candidates
  std::uint64_t near = 0;                         ///< of candidates, those known by the map
  std::uint64_t loops = 0;                        ///< verified
  std::uint64_t near_loops = 0;                   ///< of them, those from near candidates
  std::uint64_t selected = 0;                     ///< at the end
  std::uint64_t kept_loops = 0;                   ///< of the verified, those that lead into a kept map
  std::uint64_t refused = 0;                      ///< keyframes that the map did not take
  LoopMapCounters map;                            ///< what was done for room, and rejected loops asked again
};

}  // namespace swiftlet
