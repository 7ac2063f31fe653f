#pragma once
// Loops of a simulated flight, true by construction: which keyframes see a place again, and which tracks of
// theirs are the same landmark.

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "estimator/core/random.hpp"
#include "estimator/messages/loop_revisit.hpp"
#include "tests/smoother/track_flight.hpp"

namespace swiftlet::test {

struct RevisitSettings {
  double min_apart = 12;      ///< s
  double max_distance = 1.0;  ///< m
  double max_turn = 0.52;     ///< rad
  std::size_t min_matches = 15;
  std::size_t spacing = 2;        ///< every n-th keyframe looks for its loop
  double rotation_sigma = 0.003;  ///< rad, of the loops' relative poses
  double position_sigma = 0.01;   ///< m
  double wrong_share = 0;         ///< share of the matches that name another landmark
};

/// For each keyframe (frames' indices `keyframes`) at most one loop, with the old keyframe that shares most.
std::vector<LoopRevisit> trueLoops(const TrackFlight& flight, const std::vector<std::size_t>& keyframes,
                                   const RevisitSettings& settings);

}  // namespace swiftlet::test
