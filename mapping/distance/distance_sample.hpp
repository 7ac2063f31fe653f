#pragma once
// What a distance field says of a point.

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cstdint>

#include "estimator/core/stamp.hpp"

namespace swiftlet {

enum class Space : std::uint8_t { kUnknown = 0, kFree = 1, kBehindSurface = 2 };

/// Where the surface passes in a cell.
struct CellSurface {
  Eigen::Vector3f offset = Eigen::Vector3f::Zero();  ///< cells, from its middle; each within kMostOffset
  std::array<bool, 3> both_sides{};  ///< by axis: there is as much on the other side of the middle, too
};
inline constexpr float kMostOffset = 0.5F;

enum class DistanceKind : std::uint8_t {
  kUnknown,  ///< the point lies in unknown space or outside the window: nothing is clear
  kAtLeast,  ///< all known surface is farther than `distance`
  kDistance
};

struct DistanceSample {
  DistanceKind kind = DistanceKind::kUnknown;
  Space space = Space::kUnknown;  ///< of the cell that the point lies in
  /// m, to the nearest known surface; negative behind it. In unknown space, too, where surface is in reach.
  double distance = 0;
  double known_to = 0;  ///< m: so far around the point nothing is unknown
  /// Unit, away from the surface; zero where none is in reach.
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
  Stamp up_to;        ///< of the newest image that is in it
  bool stale = true;  ///< the map has newer images

  /// What a vehicle may count on [m]: unknown space is none.
  [[nodiscard]] double clearance() const { return std::clamp(distance, 0.0, known_to); }
};

}  // namespace swiftlet
