#pragma once
// How far a lens projects beside the truth, over its image: from its covariance, or from another lens.
//
// A rotation of the camera's frame is taken out, the one that leaves the least error over the pixels: no
// image tells a moved centre from a turned camera, and what a rig is calibrated to afterwards (the other
// camera, the IMU) turns with it. Source: mrcal, doc/uncertainty.org (the idea of a projection's uncertainty
// with the frame's motion removed).

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

/// Covariance of the pixel of a far point [px^2] at each pixel given; the rotation is taken out over these.
/// NaN where the lens has no inverse.
[[nodiscard]] std::vector<Eigen::Matrix2d> pixelCovariances(const CameraModel& lens,
                                                            const Eigen::Matrix<double, 8, 8>& covariance,
                                                            const std::vector<Eigen::Vector2d>& pixels);

/// 1 sigma of a pixel in its worst direction [px], at each pixel given. NaN where the lens has no inverse.
[[nodiscard]] std::vector<double> worstSigmas(const CameraModel& lens,
                                              const Eigen::Matrix<double, 8, 8>& covariance,
                                              const std::vector<Eigen::Vector2d>& pixels);

/// 1 sigma of a pixel [px], rms of the two axes, at each pixel given. NaN where the lens has no inverse.
[[nodiscard]] std::vector<double> rmsSigmas(const CameraModel& lens,
                                            const Eigen::Matrix<double, 8, 8>& covariance,
                                            const std::vector<Eigen::Vector2d>& pixels);

/// 1 sigma over the grid; points where the lens has no inverse are left out.
[[nodiscard]] std::vector<ImagePoint> projectionSigmas(const CameraModel& lens,
                                                       const Eigen::Matrix<double, 8, 8>& covariance);

/// Where `other` sees what `lens` sees at the pixels, less these [px], after the rotation that makes them
/// agree best (Cauchy weights, 1 px) at the pixels marked `fit`. NaN where one of them has no ray.
[[nodiscard]] std::vector<Eigen::Vector2d> projectionDifference(const CameraModel& lens,
                                                                const CameraModel& other,
                                                                const std::vector<Eigen::Vector2d>& pixels,
                                                                const std::vector<bool>& fit);

/// The same over the grid, fitted at all of it; left out where one of them has no ray.
[[nodiscard]] std::vector<ImagePoint> projectionDifference(const CameraModel& lens, const CameraModel& other);

/// Rms over the points.
[[nodiscard]] double rms(const std::vector<ImagePoint>& points);
/// What `part` of the points stay below.
[[nodiscard]] double quantile(const std::vector<ImagePoint>& points, double part);

}  // namespace swiftlet
