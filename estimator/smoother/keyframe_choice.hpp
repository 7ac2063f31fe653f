#pragma once
// Which keyframe of a full window goes: one whose landmarks are out of sight, else the one in the densest
// place seen from the newest state (the distance score of Engel et al., "Direct Sparse Odometry",
// PAMI 2018, eq. 20).

#include <cstddef>
#include <span>

#include "estimator/geometry/se3.hpp"

namespace swiftlet {

struct KeyframeInWindow {
  SE3 T_world_body;
  bool keyframe = false;  ///< others do not make a place dense
  int seen = 0;           ///< landmarks that it sees
  int shared = 0;         ///< of those, the ones that a recent frame sees too
};

/// Index in `window`, states in order of time, of one of the first `candidates`. O(candidates * states).
std::size_t keyframeToDrop(std::span<const KeyframeInWindow> window, std::size_t candidates);

}  // namespace swiftlet
