#pragma once
// Reads positions without attitude, as GNSS receivers and total stations give them.
//
// Rows are `t, x, y, z`, separated by commas or blanks; further columns are ignored. A stamp with a decimal
// point, or below 1e11, is in seconds, else in nanoseconds. If the header names columns `lat`, `lon` and
// `alt` (degrees, degrees, metres; also latitude, longitude, lng, altitude, height, h, ele, elevation), these
// are used instead, converted to metres east, north and up of the first row on the WGS 84 ellipsoid. Errors:
// see CsvReader.

#include <Eigen/Core>
#include <string>
#include <string_view>
#include <vector>

#include "drivers/recorded/log_warnings.hpp"
#include "estimator/core/stamp.hpp"

namespace swiftlet {

struct PositionPoint {
  Stamp stamp;
  Eigen::Vector3d p = Eigen::Vector3d::Zero();  ///< m
};

/// Whether the first row of a file is too short for a pose, or its header names a latitude.
bool isPositionFile(const std::string& path);

/// In time order.
std::vector<PositionPoint> readPositions(const std::string& path, LogCounters& counters,
                                         LogWarnings& warnings);
std::vector<PositionPoint> readPositionsText(const std::string& name, std::string_view text,
                                             LogCounters& counters, LogWarnings& warnings);

/// East, north and up [m] of a point from `origin`; both are latitude [deg], longitude [deg], height [m] (WGS
/// 84).
Eigen::Vector3d eastNorthUp(const Eigen::Vector3d& geodetic, const Eigen::Vector3d& origin);

}  // namespace swiftlet
