#pragma once
// A sample of the distance field.

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cstdint>

#include "estimator/core/stamp.hpp"

namespace swiftlet {

enum class Space : std::uint8_t { kUnknown = 0, kFree = 1, kBehindSurface = 2 };

/// The surface point inside a cell.
struct CellSurface {
  Eigen::Vector3f offset = Eigen::Vector3f::Zero();  ///< cells, from the centre; each within kMostOffset
  std::array<bool, 3> both_sides{};                  ///< by axis: there is surface at -offset too
};
inline constexpr float kMostOffset = 0.5F;

enum class DistanceKind : std::uint8_t {
  kUnknown,  ///< the point is in unknown space or outside the window: nothing is clear
  kAtLeast,  ///< all known surface is farther than `distance`
  kDistance
};

struct DistanceSample {
  DistanceKind kind = DistanceKind::kUnknown;
  Space space = Space::kUnknown;  ///< of the cell that contains the point
  /// m, to the nearest known surface; negative behind it. Also set in unknown space if surface is in reach.
  double distance = 0;
  double known_to = 0;  ///< m: radius around the point within which nothing is unknown
  /// Unit vector away from the surface; zero if none is in reach.
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
  Stamp up_to;        ///< of the newest image in the field
  bool stale = true;  ///< the map has newer images

  /// Distance that a vehicle may rely on [m]; 0 in unknown space.
  [[nodiscard]] double clearance() const { return std::clamp(distance, 0.0, known_to); }
};

}  // namespace swiftlet
