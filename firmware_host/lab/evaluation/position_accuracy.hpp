#pragma once
// A trajectory against positions without attitude, as receivers of GNSS give them.
//
// The estimate is interpolated at the truth's stamps, since it has the higher rate, and aligned as
// trajectoryError() does. Such truths have clocks of their own: a shift of the truth's stamps may be fitted,
// by the least RMSE over the shifts that keep most of the positions.

#include <optional>
#include <span>
#include <vector>

#include "drivers/recorded/position_file.hpp"
#include "firmware_host/lab/evaluation/accuracy.hpp"

namespace swiftlet {

struct PositionAccuracyOptions {
  AccuracyOptions accuracy;       ///< its from and until are the estimate's time
  std::optional<Duration> reach;  ///< shifts up to this, both ways, are tried; empty: none
};

struct PositionAccuracy {
  std::size_t positions = 0;  ///< in the file
  std::size_t pairs = 0;      ///< of them, with an estimate
  double duration = 0;        ///< s, from the first pair to the last
  Duration shift;             ///< added to the truth's stamps
  TrajectoryError absolute;   ///< its rotations, attitudes and tilts are empty
};

/// Both in time order.
PositionAccuracy positionAccuracy(const Trajectory& estimate, std::span<const PositionPoint> truth,
                                  const PositionAccuracyOptions& options);

}  // namespace swiftlet
