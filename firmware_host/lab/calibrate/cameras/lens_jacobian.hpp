#pragma once
// How a projected pixel depends on the eight parameters of a lens (estimator/camera/camera_model.hpp).

#include "estimator/camera/camera_model.hpp"

namespace swiftlet {

inline constexpr int kLensParameters = 8;  ///< fx fy cx cy, then the four of the distortion

/// d pixel / d parameters of a point that the lens projects.
[[nodiscard]] Eigen::Matrix<double, 2, kLensParameters> lensJacobian(const CameraModel& lens,
                                                                     const Eigen::Vector3d& p_cam);

/// The lens with `step` added to its parameters.
[[nodiscard]] CameraModel movedLens(const CameraModel& lens,
                                    const Eigen::Matrix<double, kLensParameters, 1>& step);

}  // namespace swiftlet
