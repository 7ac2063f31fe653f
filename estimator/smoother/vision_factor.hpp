#pragma once
// Reprojection of a landmark into a camera with Jacobians, and triangulation of the landmark at the current
// poses for its structureless elimination.
//
// The Jacobian blocks of an observation (pose and point) are taken at the same pose and point, so that the
// four unobservable directions (position, yaw) remain in the null space. For this reason the linearization of
// a rolling-shutter camera includes the rotation of its rows but no velocity; the columns of the velocity are
// omitted. Frames: points and centres in the world, rays in the camera. Residuals are in sigmas of the pixel
// noise. No allocation; triangulation is linear in observations and iterations. Sources: robust weight:
// Huber, "Robust Statistics", 1981, section 6.3. Equations: docs/smoother.md.

#include <Eigen/Core>
#include <array>
#include <span>

#include "estimator/camera/rig.hpp"
#include "estimator/messages/scan_motion.hpp"
#include "estimator/smoother/calibration_columns.hpp"
#include "estimator/smoother/landmark.hpp"
#include "estimator/smoother/state.hpp"

namespace swiftlet {

/// Motion of a camera while the rows of a rolling shutter are read. None: global shutter.
struct RowMotion {
  double readout = 0;                                  ///< s, from the first row to the last
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();  ///< of the centre, m/s, world
  Eigen::Vector3d before = Eigen::Vector3d::Zero();    ///< rad/s, camera axes: rows before the middle
  Eigen::Vector3d after = Eigen::Vector3d::Zero();     ///< rows after it

  static RowMotion of(double readout, const ScanTurn& turn, const SE3& T_body_cam, const SE3& T_world_body,
                      const Eigen::Vector3d& v_world);
  [[nodiscard]] bool none() const { return readout == 0; }
};

/// Pose of a camera in the world, from a body state.
struct CameraPose {
  Eigen::Matrix3d R_cam_world = Eigen::Matrix3d::Identity();
  Eigen::Vector3d center = Eigen::Vector3d::Zero();  ///< world; rotation and centre are at the image's stamp
  RowMotion rows;

  static CameraPose of(const SE3& T_world_body, const SE3& T_body_cam);
  /// Centre in the world when the row of an observation was read.
  [[nodiscard]] Eigen::Vector3d centerAt(const CameraSighting& sighting) const;
  /// m and W of an observation in the axes of the middle row.
  struct Seen {
    Eigen::Vector3d ray;
    Matrix23d whitening;
  };
  [[nodiscard]] Seen inMiddleRow(const CameraSighting& sighting) const;
};

/// Poses of the rig at one state. Jacobians are taken at `linearization`, which is equal except that rows
/// have no velocity.
struct RigPose {
  std::array<CameraPose, kMaxCameras> current;
  std::array<CameraPose, kMaxCameras> linearization;
  Eigen::Vector3d v_world = Eigen::Vector3d::Zero();     ///< m/s, for the time offset and rows
  Eigen::Vector3d omega_body = Eigen::Vector3d::Zero();  ///< rad/s, for the time offset and rows

  /// Places camera c at the body's pose `now`. `scan`: rotation during the rows of a rolling shutter.
  void place(std::size_t c, const SE3& T_body_cam, const SE3& now, double readout, const ScanTurn& scan);
};

/// Indexed by Sighting::slot.
using RigPoses = std::span<const RigPose>;

/// Inputs for linearizing a landmark: its views, camera poses and extrinsics. References for one call.
struct LandmarkViews {
  std::span<const Sighting> sightings;
  RigPoses poses;
  const std::array<SE3, kMaxCameras>& T_body_cam;
  CalibrationLayout calibration;
};

/// Tangent basis of the point at its bearing (world axes, orthonormal), shared by all its observations.
struct PointBasis {
  Eigen::Vector3d b1;
  Eigen::Vector3d b2;
  static PointBasis of(const Eigen::Vector3d& bearing);
};

struct SightingJacobians {
  Eigen::Matrix<double, 2, 6> pose;       ///< phi, p of the body
  Eigen::Matrix<double, 2, 3> point;      ///< two tangent coordinates of the bearing, inverse depth
  Eigen::Matrix<double, 2, 6> extrinsic;  ///< phi, p of T_body_cam
};

/// Makes an observation from the pixels of a state's cameras; `pixel_sigma` in px. A camera whose pixel has
/// no ray is unused.
[[nodiscard]] Sighting makeSighting(const Rig& rig, const std::array<bool, kMaxCameras>& seen,
                                    const std::array<Eigen::Vector2f, kMaxCameras>& pixel, double pixel_sigma,
                                    std::uint32_t slot);

/// Whitened residual, 2 x 1. False if the point is not in front of the measured ray (cosine of the angle
/// between them at most 0.2).
[[nodiscard]] bool reprojectionResidual(const CameraSighting& sighting, const CameraPose& camera,
                                        const LandmarkPoint& point, Eigen::Vector2d& residual);

/// Jacobians of the whitened residual at `camera`; `extrinsic` is only set on request. False as above.
[[nodiscard]] bool reprojectionJacobians(const CameraSighting& sighting, const CameraPose& camera,
                                         const SE3& T_body_cam, const LandmarkPoint& point,
                                         const PointBasis& basis, bool with_extrinsic,
                                         SightingJacobians& jacobians);

// Below this cosine between a point and the measured ray the tangent-plane residual is useless.
inline constexpr double kMinCosine = 0.2;
// Cauchy scale in sigmas: tracks have heavier tails than a normal distribution.
inline constexpr double kCauchyScale = 2.0;
// Makes the weighted Hessian equal to the information of the estimate if the noise is normal (2 dof):
// E[psi']^2 / (E[psi^2] E[w]) at the scale above (Huber, "Robust Statistics", 1981, section 6.3).
inline constexpr double kInformationScale = 1.267;
// Prior on the inverse depth, sigma 30 / m, for points without parallax: too weak to bias other points.
inline constexpr double kInverseDepthInformation = 1.0 / (30.0 * 30.0);  // m^2

/// Robust weight (Cauchy, scale 2 sigma) of the norm of a whitened residual, and the corresponding cost, both
/// scaled so that the weighted Hessian is the information if the noise is normal.
struct RobustWeight {
  double weight = 1;
  double cost = 0;
  /// The default `information_scale` is for two dimensions.
  static RobustWeight cauchy(double squared_norm, double information_scale = kInformationScale);
};

/// Moves the point by a step of its three coordinates; the inverse depth stays between 0 and 20 / m.
void movePoint(const Eigen::Vector3d& step, const PointBasis& basis, LandmarkPoint& point);

/// Refines the point by Gauss-Newton steps at the current poses, or triangulates it if it is not triangulated
/// yet; with 0 iterations it does not move. Sets its sigma. False if the point is behind a camera that
/// observed it, or with fewer than two observations (each camera counts).
[[nodiscard]] bool triangulate(RigPoses poses, std::span<const Sighting> sightings, int max_iterations,
                               LandmarkPoint& point);

/// Mean squared whitened residual over the observations at the current poses; negative without observations.
[[nodiscard]] double meanSquaredResidual(RigPoses poses, std::span<const Sighting> sightings,
                                         const LandmarkPoint& point);

}  // namespace swiftlet
