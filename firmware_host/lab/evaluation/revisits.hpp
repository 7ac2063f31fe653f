#pragma once
// How much of a flight comes back to where it was: what loop closure has to work on.
//
// The truth is sampled every `spacing`. A sample revisits when an earlier one, more than `min_apart` before,
// was within `max_distance` and `max_turn` of it. Cost quadratic in the samples: a millisecond for 90 s.

#include "drivers/recorded/trajectory_file.hpp"

namespace swiftlet {

struct RevisitOptions {
  Duration spacing = Duration::fromSeconds(0.5);
  Duration min_apart = Duration::fromSeconds(20);
  double max_distance = 1.0;  ///< m
  double max_turn_deg = 30;
};

struct Revisits {
  std::size_t samples = 0;
  std::size_t revisiting = 0;  ///< samples that have an older one near
  std::size_t pairs = 0;
};

/// `truth` in time order.
Revisits countRevisits(const Trajectory& truth, const RevisitOptions& options = {});

}  // namespace swiftlet
