#pragma once
// Positions in files, as receivers of GNSS and total stations give them: no attitude.
//
// Rows `t, x, y, z` with further columns that are not read, comma or blank between; a stamp with a decimal
// point, or below 1e11, is seconds, else nanoseconds. Where the header names columns `lat`, `lon` and `alt`
// (degrees, degrees, metres; also latitude, longitude, altitude, height, ele), these are taken, as metres
// east, north and up of the first row, on the WGS 84 ellipsoid. Errors: as CsvReader.

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

/// Whether a file's first row is too short for a pose, or its header names a latitude.
bool isPositionFile(const std::string& path);

/// In time order.
std::vector<PositionPoint> readPositions(const std::string& path, LogCounters& counters,
                                         LogWarnings& warnings);
std::vector<PositionPoint> readPositionsText(const std::string& name, std::string_view text,
                                             LogCounters& counters, LogWarnings& warnings);

/// East, north and up [m] of a point at `origin`; both latitude [deg], longitude [deg], height [m] (WGS 84).
Eigen::Vector3d eastNorthUp(const Eigen::Vector3d& geodetic, const Eigen::Vector3d& origin);

}  // namespace swiftlet
