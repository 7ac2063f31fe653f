#pragma once
// Projection error of a lens over its image: from its covariance, or relative to another lens.
//
// The rotation of the camera's frame that minimizes the error over the pixels is removed: images cannot
// distinguish a shifted centre from a rotated camera, and whatever is calibrated to the camera afterwards
// (the other camera, the IMU) rotates with it. Source: mrcal, doc/uncertainty.org (the uncertainty of a
// projection with the frame's motion removed).

#include <Eigen/Core>
#include <vector>

#include "estimator/camera/camera_model.hpp"

namespace swiftlet {

/// Points from edge to edge of the image.
inline constexpr int kImageGridColumns = 25;
inline constexpr int kImageGridRows = 17;

struct ImagePoint {
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  double error = 0;  ///< px, rms of the two axes
};

/// Covariance of a far point's pixel [px^2] at each given pixel; the rotation is removed over these pixels.
/// NaN where the lens has no inverse.
[[nodiscard]] std::vector<Eigen::Matrix2d> pixelCovariances(const CameraModel& lens,
                                                            const Eigen::Matrix<double, 8, 8>& covariance,
                                                            const std::vector<Eigen::Vector2d>& pixels);

/// 1 sigma in the worst direction [px], at each given pixel. NaN where the lens has no inverse.
[[nodiscard]] std::vector<double> worstSigmas(const CameraModel& lens,
                                              const Eigen::Matrix<double, 8, 8>& covariance,
                                              const std::vector<Eigen::Vector2d>& pixels);

/// 1 sigma [px], rms of the two axes, at each given pixel. NaN where the lens has no inverse.
[[nodiscard]] std::vector<double> rmsSigmas(const CameraModel& lens,
                                            const Eigen::Matrix<double, 8, 8>& covariance,
                                            const std::vector<Eigen::Vector2d>& pixels);

/// 1 sigma over the grid. At points where the lens has no inverse, it is infinite for a radial-tangential
/// lens: its distortion folds inside the image, and nothing is known there. Such points of a fisheye are
/// omitted: they are usually the dark corners of its image.
[[nodiscard]] std::vector<ImagePoint> projectionSigmas(const CameraModel& lens,
                                                       const Eigen::Matrix<double, 8, 8>& covariance);

/// Share of the grid's pixels that have a ray.
[[nodiscard]] double rayShare(const CameraModel& lens);

/// Where `other` projects what `lens` sees at the pixels, minus these pixels [px], after the rotation that
/// makes them agree best (Cauchy weights, 1 px) at the pixels marked `fit`. NaN where either has no ray.
[[nodiscard]] std::vector<Eigen::Vector2d> projectionDifference(const CameraModel& lens,
                                                                const CameraModel& other,
                                                                const std::vector<Eigen::Vector2d>& pixels,
                                                                const std::vector<bool>& fit);

/// The same over the whole grid, fitted to all of it; points where either has no ray are omitted.
[[nodiscard]] std::vector<ImagePoint> projectionDifference(const CameraModel& lens, const CameraModel& other);

/// Rms over the points with a finite error.
[[nodiscard]] double rms(const std::vector<ImagePoint>& points);
/// The value that `part` of the points do not exceed.
[[nodiscard]] double quantile(const std::vector<ImagePoint>& points, double part);

}  // namespace swiftlet
