#pragma once
// How well a lens is known: over the image, in pixels.

#include <Eigen/Core>
#include <vector>

#include "estimator/camera/camera_model.hpp"

namespace swiftlet {

/// Standard deviation of the pixel of a far point in its worst direction [px], at each pixel given. The
/// rotation that best compensates the lens's error over these pixels is taken out: a calibrated rig that is
/// turned as a whole sees the same. NaN where the lens has no ray.
std::vector<double> projectionSigmas(const CameraModel& model, const Eigen::Matrix<double, 8, 8>& covariance,
                                     const std::vector<Eigen::Vector2d>& pixels);

/// Where lens `b` sees what lens `a` sees at the pixels, less these [px], after the rotation that makes them
/// agree best (Cauchy weights, 1 px) at the pixels marked `fit`. NaN where one of them has no ray.
std::vector<Eigen::Vector2d> projectionDifference(const CameraModel& a, const CameraModel& b,
                                                  const std::vector<Eigen::Vector2d>& pixels,
                                                  const std::vector<bool>& fit);

}  // namespace swiftlet
