#pragma once
// Exact geometric predicates in the plane: side of a line, inside or outside of a circle.
//
// Points are snapped once to a grid of 2^-12 px, far finer than the accuracy of a feature. On the grid the
// side of a line is exact in doubles. The circle is decided by a floating-point filter or, if that cannot
// decide, by integers of 128 bits. These are the first and the last of the stages of Shewchuk 1997, "Adaptive
// Precision Floating-Point Arithmetic and Fast Robust Geometric Predicates"; the grid makes the others
// unnecessary.
//
// Bounds, with integer coordinates within +-2^25 steps: differences are at most D = 2^26, so products,
// squared lengths and cross products are integers of at most 2 D^2 = 2^53, which a double holds exactly
// (fused or not). The in-circle determinant is the sum of three products of two such numbers, < 2^108.

#include <Eigen/Core>
#include <cmath>
#include <compare>
#include <cstdint>

namespace swiftlet {

/// Grid steps per pixel. Snapping moves a coordinate by at most half a step, 1.2e-4 px, and does not move
/// coordinates of 2048 px or more.
inline constexpr double kGridStepsPerPixel = 4096;
/// Coordinates beyond this are rejected [px]: 2^13 px are 2^25 grid steps, the bound above.
inline constexpr float kGridRange = 8192;

/// A point in grid steps: integers within +-2^25.
struct GridPoint {
  double x = 0;
  double y = 0;

  friend constexpr bool operator==(const GridPoint&, const GridPoint&) = default;
};

/// Order by x, then by y.
constexpr bool isBefore(const GridPoint& a, const GridPoint& b) {
  return a.x < b.x || (a.x == b.x && a.y < b.y);
}

/// The grid point nearest to `pixel`, ties to even. False, without effect, if it is not finite or out of
/// range.
inline bool snapToGrid(const Eigen::Vector2f& pixel, GridPoint& point) {
  // Written so that NaN fails the test.
  if (!(std::abs(pixel.x()) <= kGridRange && std::abs(pixel.y()) <= kGridRange)) return false;
  // The product by a power of two is exact; only the conversion rounds.
  point.x = static_cast<double>(std::lrint(kGridStepsPerPixel * pixel.x()));
  point.y = static_cast<double>(std::lrint(kGridStepsPerPixel * pixel.y()));
  return true;
}

/// Twice the signed area of the triangle a, b, c [grid steps squared], exact. Positive if c is left of the
/// line from a to b (x axis to y axis is a left turn), 0 if the three are collinear.
constexpr double orientation(const GridPoint& a, const GridPoint& b, const GridPoint& c) {
  return (a.x - c.x) * (b.y - c.y) - (a.y - c.y) * (b.x - c.x);
}

/// Vector from one point to another with its squared length; all exact.
struct GridArm {
  double x = 0;
  double y = 0;
  double squared = 0;
};

constexpr GridArm armOf(const GridPoint& from, const GridPoint& to) {
  const double x = to.x - from.x;
  const double y = to.y - from.y;
  return {x, y, x * x + y * y};
}

/// inCircle() if floating point can decide: +1 or -1. Otherwise 0, also if an arm is NaN.
///
/// With unit roundoff u = 2^-53, l the squared lengths and s their sum, each product l_i cross_jk is at most
/// l_i (l_j + l_k) / 2 and the three together at most s^2 / 3. They are rounded once, and their sum twice:
/// the error is below 3 (1 + 2 u) u s^2 / 3, half of the bound.
constexpr int inCircleByFilter(const GridArm& a, const GridArm& b, const GridArm& c) {
  constexpr double kErrorShare = 0x1p-52;
  const double sum = a.squared * (b.x * c.y - b.y * c.x) + b.squared * (c.x * a.y - c.y * a.x) +
                     c.squared * (a.x * b.y - a.y * b.x);
  const double lengths = a.squared + b.squared + c.squared;
  const double bound = kErrorShare * lengths * lengths;
  if (sum > bound) return 1;
  return sum < -bound ? -1 : 0;
}

/// inCircle() by exact integers.
constexpr int inCircleInIntegers(const GridArm& a, const GridArm& b, const GridArm& c) {
  const auto cross = [](const GridArm& u, const GridArm& v) {
    return static_cast<std::int64_t>(u.x * v.y - u.y * v.x);
  };
  const auto product = [](double squared, std::int64_t area) {
    return static_cast<__int128>(static_cast<std::int64_t>(squared)) * area;
  };
  const __int128 sum =
      product(a.squared, cross(b, c)) + product(b.squared, cross(c, a)) + product(c.squared, cross(a, b));
  return (sum > 0 ? 1 : 0) - (sum < 0 ? 1 : 0);
}

/// Exact sign: +1 if the point at which the arms start is inside the circle through their ends a, b, c
/// (counter-clockwise), -1 outside, 0 on it. For clockwise ends the sign is reversed. For collinear ends it
/// gives the side of their line.
constexpr int inCircle(const GridArm& a, const GridArm& b, const GridArm& c) {
  const int side = inCircleByFilter(a, b, c);
  return side != 0 ? side : inCircleInIntegers(a, b, c);
}

/// The same for the point d.
constexpr int inCircle(const GridPoint& a, const GridPoint& b, const GridPoint& c, const GridPoint& d) {
  return inCircle(armOf(d, a), armOf(d, b), armOf(d, c));
}

}  // namespace swiftlet
