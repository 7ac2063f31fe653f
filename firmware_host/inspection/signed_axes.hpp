#pragma once
// Axes that are exchanged or negated.

#include <Eigen/Core>
#include <string>
#include <vector>

namespace swiftlet {

/// The 48 orthogonal matrices that exchange and negate axes.
std::vector<Eigen::Matrix3d> signedAxes();
/// The nearest of them with the same determinant; `angle` [rad] to it.
Eigen::Matrix3d nearestSignedAxes(const Eigen::Matrix3d& orthogonal, double& angle);
/// "x for -y, y for x": the axes that are others, `axes` * true = given.
std::string axesText(const Eigen::Matrix3d& axes);

}  // namespace swiftlet
