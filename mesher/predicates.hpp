#pragma once
// Exact geometric predicates in the plane: on which side of a line, inside or outside of a circle.
//
// Points are snapped once to a grid of 2^-14 px; on the grid both signs are computed in integers without any
// rounding, so there is no filter and no second, slower path. (Adaptive floating point after Shewchuk 1997,
// "Adaptive Precision Floating-Point Arithmetic and Fast Robust Geometric Predicates", keeps every bit of the
// input; here its last bits carry nothing: 2^-14 px is the spacing of floats between 512 and 1024.)
//
// Bounds, with coordinates within +-2^29 grid steps: differences D <= 2^30; cross products and squared
// lengths
// <= 2 D^2 = 2^61 < 2^63 (64 bit); the in-circle determinant is three products of such two, < 2^124 (128
// bit).

#include <Eigen/Core>
#include <cmath>
#include <cstdint>

namespace swiftlet {

/// Grid steps in a pixel. Snapping moves a coordinate by at most half a step, 3e-5 px; none of 512 px or
/// more.
inline constexpr float kGridStepsPerPixel = 16384.0F;
/// Coordinates beyond this are refused [px]: 2^15 px are 2^29 grid steps, the bound above.
inline constexpr float kGridRange = 32768.0F;

/// A point in grid steps, each coordinate within +-2^29.
struct GridPoint {
  std::int32_t x = 0;
  std::int32_t y = 0;

  friend constexpr bool operator==(const GridPoint&, const GridPoint&) = default;
  /// By x, then by y.
  friend constexpr auto operator<=>(const GridPoint&, const GridPoint&) = default;
};

/// The grid point nearest to `pixel`, ties to even; false (and no change) if it is not finite or out of
/// range.
inline bool snapToGrid(const Eigen::Vector2f& pixel, GridPoint& point) {
  // Written so that a NaN fails it.
  if (!(std::abs(pixel.x()) <= kGridRange && std::abs(pixel.y()) <= kGridRange)) return false;
  // The product by a power of two is exact; only lrint rounds.
  point.x = static_cast<std::int32_t>(std::lrint(pixel.x() * kGridStepsPerPixel));
  point.y = static_cast<std::int32_t>(std::lrint(pixel.y() * kGridStepsPerPixel));
  return true;
}

/// Twice the signed area of the triangle a, b, c [grid steps squared], exact: positive if c is to the left of
/// the line from a to b (x axis to y axis is a left turn), 0 if the three are collinear.
constexpr std::int64_t orientation(const GridPoint& a, const GridPoint& b, const GridPoint& c) {
  const std::int64_t ax = std::int64_t{a.x} - c.x;
  const std::int64_t ay = std::int64_t{a.y} - c.y;
  const std::int64_t bx = std::int64_t{b.x} - c.x;
  const std::int64_t by = std::int64_t{b.y} - c.y;
  return ax * by - ay * bx;
}

/// Sign, exact: +1 if d is inside the circle through a, b, c (counter-clockwise), -1 outside, 0 on it. For
/// clockwise a, b, c the sign is the opposite; for collinear ones it tells the side of their line instead.
constexpr int inCircle(const GridPoint& a, const GridPoint& b, const GridPoint& c, const GridPoint& d) {
  const std::int64_t ax = std::int64_t{a.x} - d.x;
  const std::int64_t ay = std::int64_t{a.y} - d.y;
  const std::int64_t bx = std::int64_t{b.x} - d.x;
  const std::int64_t by = std::int64_t{b.y} - d.y;
  const std::int64_t cx = std::int64_t{c.x} - d.x;
  const std::int64_t cy = std::int64_t{c.y} - d.y;
  using Wide = __int128;
  const Wide determinant = static_cast<Wide>(ax * ax + ay * ay) * (bx * cy - by * cx) +
                           static_cast<Wide>(bx * bx + by * by) * (cx * ay - cy * ax) +
                           static_cast<Wide>(cx * cx + cy * cy) * (ax * by - ay * bx);
  return (determinant > 0 ? 1 : 0) - (determinant < 0 ? 1 : 0);
}

}  // namespace swiftlet
