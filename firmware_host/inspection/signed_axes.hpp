#pragma once
// Permutations and sign changes of axes.

#include <Eigen/Core>
#include <string>
#include <vector>

namespace swiftlet {

/// The 48 orthogonal matrices that permute and negate axes.
std::vector<Eigen::Matrix3d> signedAxes();
/// The nearest of these matrices with the same determinant; `angle` [rad] is the distance to it.
Eigen::Matrix3d nearestSignedAxes(const Eigen::Matrix3d& orthogonal, double& angle);
/// "x for -y, y for x": the axes that differ, with `axes` * true = given.
std::string axesText(const Eigen::Matrix3d& axes);

}  // namespace swiftlet
