#pragma once
// True depth of the rendered logs at a raw pixel's bearing.

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "tests/frontend/log_reader.hpp"

namespace swiftlet::testing {

// Depth camera of the rendered logs: an ideal pinhole at cam0's pose.
inline constexpr double kDepthFocal = 430.0;
inline constexpr double kDepthCx = 375.5;
inline constexpr double kDepthCy = 239.5;
// Depths of a 4x4 neighbourhood further apart than this share lie on an edge.
inline constexpr double kMaxDepthStep = 0.06;

/// z [m] along `bearing` (cam0), interpolated in inverse depth; false outside and on depth edges.
inline bool depthAt(const DepthImage& depth, const Eigen::Vector3d& bearing, double& z) {
  const double u = kDepthFocal * bearing.x() / bearing.z() + kDepthCx;
  const double v = kDepthFocal * bearing.y() / bearing.z() + kDepthCy;
  const int x = static_cast<int>(std::floor(u));
  const int y = static_cast<int>(std::floor(v));
  if (x < 1 || y < 1 || x + 2 >= depth.width || y + 2 >= depth.height) return false;
  double low = 1e9;
  double high = 0;
  double sum = 0;
  for (int j = -1; j <= 2; ++j) {
    for (int i = -1; i <= 2; ++i) {
      const double d = depth.millimetres[static_cast<std::size_t>((y + j) * depth.width + x + i)];
      if (d <= 0) return false;
      low = std::min(low, d);
      high = std::max(high, d);
      if (i < 0 || i > 1 || j < 0 || j > 1) continue;
      sum += (i == 0 ? 1 - (u - x) : u - x) * (j == 0 ? 1 - (v - y) : v - y) / d;
    }
  }
  if (high > low * (1 + kMaxDepthStep)) return false;
  z = 1e-3 / sum;
  return true;
}

}  // namespace swiftlet::testing
