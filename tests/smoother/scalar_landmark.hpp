#pragma once
// A landmark linearized and eliminated view by view, with Eigen: the twin of
// estimator/smoother/landmark_block.hpp.

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <cmath>

#include "estimator/smoother/landmark_block.hpp"
#include "estimator/smoother/vision_factor.hpp"

namespace swiftlet::test {

inline constexpr double kPointDamping = 1e-9;  // as PointFactor

/// The system of a landmark: calibration, then the poses of the slots in use, then the point's three columns.
/// `columns[slot]`: first column of a pose.
struct ScalarLandmark {
  Eigen::MatrixXd H;
  Eigen::VectorXd g;
  double cost = 0;
  int states = 0;  ///< that have the point in front of a camera

  ScalarLandmark(Eigen::Index columns)
      : H(Eigen::MatrixXd::Zero(columns, columns)), g(Eigen::VectorXd::Zero(columns)) {}

  /// `basis` unused for a position.
  void add(const LandmarkViews& views, const LandmarkPoint& point, const PointBasis& basis, bool position,
           std::span<const Eigen::Index> pose_column) {
    for (const Sighting& sighting : views.sightings) {
      bool valid = false;
      for (std::size_t c = 0; c < kMaxCameras; ++c) {
        const CameraSighting& view = sighting.camera[c];
        const RigPose& rig = views.poses[sighting.slot];
        Eigen::Vector2d r;
        SightingJacobians J;
        if (!view.used || !reprojectionResidual(view, rig.current[c], point, r) ||
            !reprojectionJacobians(view, rig.linearization[c], views.T_body_cam[c], point, basis, true, J)) {
          continue;
        }
        Eigen::MatrixXd row = Eigen::MatrixXd::Zero(2, H.cols());
        row.rightCols<3>() = position ? Eigen::Matrix<double, 2, 3>(-J.pose.rightCols<3>()) : J.point;
        row.middleCols<kPoseDim>(pose_column[sighting.slot]) = J.pose;
        if (views.calibration.time_offset) {
          row.col(0) = J.pose.leftCols<3>() * rig.omega_body + J.pose.rightCols<3>() * rig.v_world;
        }
        if (views.calibration.readout) row.col(1) = static_cast<double>(view.row) * row.col(0);
        if (views.calibration.extrinsics) {
          row.middleCols<kPoseDim>(views.calibration.extrinsicOffset(c)) = J.extrinsic;
        }
        const RobustWeight robust = RobustWeight::cauchy(r.squaredNorm());
        H += robust.weight * row.transpose() * row;
        g += robust.weight * row.transpose() * r;
        cost += robust.cost;
        valid = true;
      }
      states += int{valid};
    }
  }

  /// The point's columns become meaningless. False as LandmarkBlock::eliminate().
  [[nodiscard]] bool eliminate() {
    if (states < 2) return false;
    const Eigen::Index n = H.cols() - 3;
    Eigen::Matrix3d C = H.bottomRightCorner<3, 3>();
    C(2, 2) += kInverseDepthInformation;
    C.diagonal() *= 1.0 + kPointDamping;
    const Eigen::LLT<Eigen::Matrix3d> llt(C);
    if (llt.info() != Eigen::Success) return false;
    const Eigen::MatrixXd B = H.topRightCorner(n, 3);
    H.topLeftCorner(n, n) -= B * llt.solve(B.transpose());
    g.head(n) -= B * llt.solve(g.tail<3>());
    return true;
  }
};

}  // namespace swiftlet::test
