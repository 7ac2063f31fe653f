#include "firmware_host/inspection/signed_axes.hpp"

#include <fmt/format.h>

#include <Eigen/LU>

#include <algorithm>
#include <array>
#include <cmath>

namespace swiftlet {

std::vector<Eigen::Matrix3d> signedAxes() {
  std::vector<Eigen::Matrix3d> all;
  std::array<int, 3> order{0, 1, 2};
  do {
    for (int signs = 0; signs < 8; ++signs) {
      Eigen::Matrix3d axes = Eigen::Matrix3d::Zero();
      for (int i = 0; i < 3; ++i) {
        axes(i, order[static_cast<std::size_t>(i)]) = ((signs >> i) & 1) != 0 ? -1 : 1;
      }
      all.push_back(axes);
    }
  } while (std::ranges::next_permutation(order).found);
  return all;
}

Eigen::Matrix3d nearestSignedAxes(const Eigen::Matrix3d& orthogonal, double& angle) {
  Eigen::Matrix3d nearest = Eigen::Matrix3d::Identity();
  double most = -3;
  for (const Eigen::Matrix3d& axes : signedAxes()) {
    const double trace = (axes.transpose() * orthogonal).trace();
    if (axes.determinant() * orthogonal.determinant() < 0 || trace <= most) continue;
    most = trace;
    nearest = axes;
  }
  angle = std::acos(std::clamp(0.5 * (most - 1), -1.0, 1.0));
  return nearest;
}

std::string axesText(const Eigen::Matrix3d& axes) {
  std::string text;
  for (int i = 0; i < 3; ++i) {
    Eigen::Index from = 0;
    axes.row(i).cwiseAbs().maxCoeff(&from);
    const bool negative = axes(i, from) < 0;
    if (from == i && !negative) continue;
    text +=
        fmt::format("{}{} for {}{}", text.empty() ? "" : ", ", "xyz"[i], negative ? "-" : "", "xyz"[from]);
  }
  return text;
}

}  // namespace swiftlet
