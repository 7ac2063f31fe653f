#pragma once
// Chooses the keyframe that leaves a full window: one whose landmarks are out of sight, otherwise the one in
// the densest place relative to the newest state (distance score of Engel et al., "Direct Sparse Odometry",
// PAMI 2018, eq. 20).

#include <cstddef>
#include <span>

#include "estimator/geometry/se3.hpp"

namespace swiftlet {

struct KeyframeInWindow {
  SE3 T_world_body;
  bool keyframe = false;  ///< other states do not count for the density
  int seen = 0;           ///< number of landmarks that it sees
  int shared = 0;         ///< of these, landmarks also seen in a recent frame
};

/// Returns the index in `window` (states in order of time) of one of the first `candidates`. O(candidates *
/// states).
std::size_t keyframeToDrop(std::span<const KeyframeInWindow> window, std::size_t candidates);

}  // namespace swiftlet
