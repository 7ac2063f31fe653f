#pragma once
// Compares the loops of a run with the truth: how many of the verified and of the selected ones show the same
// place.

#include <cstddef>
#include <span>

#include "firmware_host/lab/evaluation/association.hpp"
#include "mapping/loop/loop_stage.hpp"

namespace swiftlet {

/// A loop that is off by more than either of these is false.
inline constexpr double kFalseLoopDistance = 0.3;  // m
inline constexpr double kFalseLoopDegrees = 6;

struct LoopAccuracy {
  std::size_t verified = 0;  ///< verified loops with truth at both ends
  std::size_t verified_right = 0;
  std::size_t selected = 0;
  std::size_t selected_right = 0;
  std::size_t without_truth = 0;
  double median_distance = 0;  ///< m, of the correct loops
  double median_degrees = 0;   ///< rotation, of the correct loops
};

/// Loops whose newer end is outside the section are omitted.
LoopAccuracy loopAccuracy(std::span<const MapLoop> loops, const Trajectory& truth,
                          const AssociationOptions& options);

}  // namespace swiftlet
