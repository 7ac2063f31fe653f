#pragma once
// Measures how much of a flight returns to earlier places, where loop closure can work.
//
// The truth is sampled every `spacing`. A sample is a revisit if an earlier one, more than `min_apart`
// before, was within `max_distance` and `max_turn` of it. Cost quadratic in the samples: a millisecond for 90
// s.

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
  std::size_t revisiting = 0;  ///< samples with an earlier one nearby
  std::size_t pairs = 0;
};

/// `truth` in time order.
Revisits countRevisits(const Trajectory& truth, const RevisitOptions& options = {});

}  // namespace swiftlet
