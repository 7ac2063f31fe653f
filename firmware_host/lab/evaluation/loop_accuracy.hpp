#pragma once
// Loops of a run against the truth: how many of those verified, and of those believed, show the same place.

#include <cstddef>
#include <span>

#include "firmware_host/lab/evaluation/association.hpp"
#include "mapping/loop/loop_stage.hpp"

namespace swiftlet {

/// A loop further off than either of these is a false one.
inline constexpr double kFalseLoopDistance = 0.3;  // m
inline constexpr double kFalseLoopDegrees = 6;

struct LoopAccuracy {
  std::size_t verified = 0;  ///< with truth at both ends
  std::size_t verified_right = 0;
  std::size_t selected = 0;
  std::size_t selected_right = 0;
  std::size_t without_truth = 0;
  double median_distance = 0;  ///< m, of the right ones
  double median_degrees = 0;   ///< rotation, of the right ones
};

LoopAccuracy loopAccuracy(std::span<const MapLoop> loops, const Trajectory& truth, Duration max_gap);

}  // namespace swiftlet
