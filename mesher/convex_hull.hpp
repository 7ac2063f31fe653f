#pragma once
// Convex hull of image points, counter-clockwise in the axes of the input, without points on its sides.
// Monotone chain (Andrew, "Another efficient algorithm for convex hulls in two dimensions", 1979), O(n log
// n). Signs in double precision, exact for pixels with a resolution of 2^-10.

#include <Eigen/Core>
#include <algorithm>

#include "estimator/core/fixed_vector.hpp"
#include "estimator/core/limits.hpp"

namespace swiftlet {

using HullPoints = FixedVector<Eigen::Vector2f, kMaxFeatures>;

/// Sorts `points`. Returns fewer than three if they are collinear.
inline void convexHull(HullPoints& points, HullPoints& hull) {
  std::sort(points.begin(), points.end(), [](const Eigen::Vector2f& a, const Eigen::Vector2f& b) {
    return a.x() != b.x() ? a.x() < b.x() : a.y() < b.y();
  });
  hull.clear();
  const auto turns_left = [&hull](const Eigen::Vector2f& p) {
    const Eigen::Vector2d a = hull[hull.size() - 2].cast<double>();
    const Eigen::Vector2d ab = hull.back().cast<double>() - a;
    const Eigen::Vector2d ap = p.cast<double>() - a;
    return ab.x() * ap.y() - ab.y() * ap.x() > 0;
  };
  // Along the lower side, then back along the upper side from the end of the lower.
  std::size_t begin = 0;
  const auto add = [&](const Eigen::Vector2f& p) {
    while (hull.size() >= begin + 2 && !turns_left(p)) hull.popBack();
    static_cast<void>(hull.tryPushBack(p));
  };
  for (const Eigen::Vector2f& p : points) add(p);
  begin = hull.empty() ? 0 : hull.size() - 1;
  for (std::size_t i = points.size(); i-- > 0;) add(points[i]);
  if (hull.size() > 1) hull.popBack();  // the first point again
}

}  // namespace swiftlet
