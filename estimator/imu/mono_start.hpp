#pragma once
// Start in motion with one camera: velocity (hence scale), tilt and biases from bearings and IMU.
//
// Model: the camera's positions follow from v, tilt and biases as in start_parameters.hpp. A track seen in
// frames i and j gives n . (c_j - c_i) = 0 with n = (R_i f_i) x (R_j f_j), which is linear in v and gravity
// and needs no point. Steps: gyro bias from the smallest eigenvalue of sum n n' per frame pair; linear v and
// tilt, reweighted to angular residuals; then Levenberg-Marquardt on the angular reprojection errors of all
// tracks with the points eliminated, which gives the covariance.
// Scale is observable only with acceleration, and `scale_sigma` tells how well it is known. It is large near
// constant velocity, pure rotation and rest, and the caller must then wait (docs/imu.md).
// Frames: body axes at image 0.
// Errors: kNotReady (fewer than 4 frames or 15 tracks), kDegenerate (no parallax), kNumerical.
// Memory: about 20 kB on the stack; no allocation. Cost: 5 to 15 ms for 100 tracks over 10 frames, once per
// start.
// Sources: Kneip, Lynen, "Direct Optimization of Frame-to-Frame Rotation", ICCV 2013 (eigenvalue);
// He, Xu, Ouyang, Li, "A Rotation-Translation-Decoupled Solution for Robust and Efficient
// Visual-Inertial Initialization", CVPR 2023 (structureless linear solve); Schur elimination: Triggs
// et al., "Bundle Adjustment - A Modern Synthesis", 1999.

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "estimator/core/status.hpp"
#include "estimator/geometry/se3.hpp"
#include "estimator/imu/imu_noise.hpp"
#include "estimator/imu/initialization.hpp"
#include "estimator/imu/preintegration.hpp"
#include "estimator/imu/start_parameters.hpp"

namespace swiftlet {

/// Frames of a mono start: 1.5 s at 10 Hz (use every second image of a faster camera).
inline constexpr std::size_t kMaxMonoFrames = 16;
inline constexpr std::size_t kMaxMonoTracks = 200;

/// Bearings of a landmark in the frames of the start (frame 0 is the first image).
struct BearingTrack {
  std::uint32_t seen = 0;                               ///< bit k: seen in frame k
  std::array<Eigen::Vector3d, kMaxMonoFrames> bearing;  ///< unit, camera axes
};

struct MonoStart {
  MotionStart motion;        ///< state at image 0
  double scale_sigma = 1e9;  ///< relative sigma of the scale of the path (1 = 100 %)
  double parallax = 0;       ///< rad, median over the tracks of the largest angle after derotation
  int tracks = 0;            ///< tracks accepted
};

/// `from_first[k - 1]`: preintegration from image 0 to image k. `bearing_sigma`: rad per axis.
/// Frames beyond kMaxMonoFrames and tracks beyond kMaxMonoTracks are not used.
Status solveMonoStart(std::span<const Preintegration> from_first, std::span<const BearingTrack> tracks,
                      const SE3& T_body_cam, double bearing_sigma, const TiltEstimate& tilt,
                      const ImuNoise& noise, const StartPrior& prior, MonoStart& start);

/// Gyro bias only: minimizes the smallest eigenvalues of the epipolar planes over bg, with or without
/// translation. `sigma`: rad/s, the largest principal sigma, prior included. Use it only as an initial guess:
/// if rotation and sideways motion look alike (3 % of simulated starts), it is off by 5 to 15 sigma.
Status solveGyroBias(std::span<const Preintegration> from_first, std::span<const BearingTrack> tracks,
                     const SE3& T_body_cam, double bearing_sigma, const StartPrior& prior,
                     Eigen::Vector3d& bias_gyro, double& sigma);

}  // namespace swiftlet
