#pragma once
// Jacobians by central differences, on manifolds, to check the written ones against.
//
// A point type needs `boxPlus(point, delta)`; a value type needs `boxMinus(value, reference)`.
// Vectors and rotations are given here (rotations right-perturbed, R Exp(delta)); a room adds
// overloads for its own states, found by argument-dependent lookup or passed as functors.

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>

#include "estimator/geometry/se3.hpp"
#include "estimator/geometry/so3.hpp"

namespace swiftlet::test {

/// Error of central differences: step^2 (truncation) + 1e-16 / step (rounding), least near 1e-5.
inline constexpr double kDifferenceStep = 1e-5;

template <int kRows>
Eigen::Matrix<double, kRows, 1> boxPlus(const Eigen::Matrix<double, kRows, 1>& x,
                                        const Eigen::Matrix<double, kRows, 1>& delta) {
  return x + delta;
}
template <int kRows>
Eigen::Matrix<double, kRows, 1> boxMinus(const Eigen::Matrix<double, kRows, 1>& x,
                                         const Eigen::Matrix<double, kRows, 1>& reference) {
  return x - reference;
}
inline Eigen::Quaterniond boxPlus(const Eigen::Quaterniond& q, const Eigen::Vector3d& phi) {
  return (q * expSo3(phi)).normalized();
}
inline Eigen::Vector3d boxMinus(const Eigen::Quaterniond& q, const Eigen::Quaterniond& reference) {
  return logSo3(reference.conjugate() * q);
}
inline double boxMinus(double x, double reference) { return x - reference; }
/// Pose: (phi, p), R <- R Exp(phi), p <- p + dp.
inline SE3 boxPlus(const SE3& T, const Eigen::Matrix<double, 6, 1>& delta) {
  return {boxPlus(T.rotation, Eigen::Vector3d(delta.head<3>())), T.translation + delta.tail<3>()};
}
inline Eigen::Matrix<double, 6, 1> boxMinus(const SE3& T, const SE3& reference) {
  Eigen::Matrix<double, 6, 1> delta;
  delta << boxMinus(T.rotation, reference.rotation), T.translation - reference.translation;
  return delta;
}

/// d function / d delta at `x`, where x is perturbed by boxPlus in `kSize` directions and values
/// are compared by boxMinus; `kRows` is the size of the result. `plus` and `minus` replace the two.
template <int kRows, int kSize, typename Function, typename Point, typename Plus, typename Minus>
Eigen::Matrix<double, kRows, kSize> numericJacobian(const Function& function, const Point& x,
                                                    const Plus& plus, const Minus& minus,
                                                    double step = kDifferenceStep) {
  Eigen::Matrix<double, kRows, kSize> jacobian;
  const auto reference = function(x);
  for (int i = 0; i < kSize; ++i) {
    Eigen::Matrix<double, kSize, 1> delta = Eigen::Matrix<double, kSize, 1>::Zero();
    delta[i] = step;
    const Eigen::Matrix<double, kRows, 1> ahead(minus(function(plus(x, delta)), reference));
    delta[i] = -step;
    const Eigen::Matrix<double, kRows, 1> back(minus(function(plus(x, delta)), reference));
    jacobian.col(i) = (ahead - back) / (2.0 * step);
  }
  return jacobian;
}

template <int kRows, int kSize, typename Function, typename Point>
Eigen::Matrix<double, kRows, kSize> numericJacobian(const Function& function, const Point& x,
                                                    double step = kDifferenceStep) {
  return numericJacobian<kRows, kSize>(
      function, x, [](const auto& point, const auto& delta) { return boxPlus(point, delta); },
      [](const auto& value, const auto& reference) { return boxMinus(value, reference); }, step);
}

/// Largest difference of two matrices over the largest entry of `expected` (at least 1).
template <typename A, typename B>
double relativeDifference(const Eigen::MatrixBase<A>& actual, const Eigen::MatrixBase<B>& expected) {
  const double scale = std::max(1.0, expected.cwiseAbs().maxCoeff());
  return (actual - expected).cwiseAbs().maxCoeff() / scale;
}

}  // namespace swiftlet::test
