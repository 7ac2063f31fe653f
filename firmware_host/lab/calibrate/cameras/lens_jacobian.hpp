#pragma once
// Derivatives of a projected pixel by the eight parameters of a lens (estimator/camera/camera_model.hpp).

#include "estimator/camera/camera_model.hpp"

namespace swiftlet {

inline constexpr int kLensParameters = 8;  ///< fx fy cx cy, then four distortion terms

/// d pixel / d parameters, for a point that the lens can project.
[[nodiscard]] Eigen::Matrix<double, 2, kLensParameters> lensJacobian(const CameraModel& lens,
                                                                     const Eigen::Vector3d& p_cam);

/// The lens with `step` added to its parameters.
[[nodiscard]] CameraModel movedLens(const CameraModel& lens,
                                    const Eigen::Matrix<double, kLensParameters, 1>& step);

}  // namespace swiftlet
