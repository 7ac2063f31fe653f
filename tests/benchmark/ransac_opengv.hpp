#pragma once
// OpenGV behind plain types. Debian builds it for baseline x86-64, where Eigen aligns to 16 bytes:
// it lives in a library of its own, built alike, so that no Eigen code of the two mixes.

#include <array>
#include <vector>

namespace swiftlet::test {

using Bearing = std::array<double, 3>;

struct OpengvResult {
  std::array<double, 12> motion{};  ///< [R t] of p_cur = R p_prev + t, row-major
  std::vector<int> inliers;
};

OpengvResult opengvFivePointRansac(const std::vector<Bearing>& prev, const std::vector<Bearing>& cur,
                                   double threshold, double confidence, int max_iterations);
/// CPU time of one fivept_nister on five bearings.
double opengvFivePointMicroseconds(const std::vector<Bearing>& prev, const std::vector<Bearing>& cur,
                                   int repeats);

}  // namespace swiftlet::test
