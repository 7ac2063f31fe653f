#pragma once
// Compares a trajectory with positions without attitude, such as those of GNSS receivers.
//
// The estimate is interpolated at the truth's stamps, because it has the higher rate, and aligned as in
// trajectoryError(). Such truths have their own clocks: a shift of the truth's stamps may be fitted, by the
// smallest RMSE over the shifts that keep most of the positions.

#include <optional>
#include <span>
#include <vector>

#include "drivers/recorded/position_file.hpp"
#include "firmware_host/lab/evaluation/accuracy.hpp"

namespace swiftlet {

struct PositionAccuracyOptions {
  AccuracyOptions accuracy;       ///< its from and until are times of the estimate
  std::optional<Duration> reach;  ///< shifts up to this in both directions are tried; empty: no shift
};

struct PositionAccuracy {
  std::size_t positions = 0;  ///< in the file
  std::size_t pairs = 0;      ///< of these, with an estimate
  double duration = 0;        ///< s, from the first pair to the last
  Duration shift;             ///< added to the truth's stamps
  TrajectoryError absolute;   ///< its rotation, attitude and tilt are empty
};

/// Both in time order.
PositionAccuracy positionAccuracy(const Trajectory& estimate, std::span<const PositionPoint> truth,
                                  const PositionAccuracyOptions& options);

}  // namespace swiftlet
