#include "estimator/smoother/extra_factors.hpp"

#include <cmath>

namespace swiftlet {
namespace {

// As kInformationScale (vision_factor.hpp), for a residual of one dimension.
constexpr double kInformationScale1 = 1.099;

// Any bearing does: the point's own columns are not taken from it.
LandmarkPoint pointAt(const Eigen::Vector3d& p) {
  LandmarkPoint point;
  point.triangulated = true;
  point.bearing = Eigen::Vector3d::UnitZ();
  point.reference = p - point.bearing;
  point.inverse_depth = 1;
  return point;
}

void weigh(double information_scale, LinearFactor& linear) {
  const RobustWeight robust = RobustWeight::cauchy(linear.residual.squaredNorm(), information_scale);
  const double root = std::sqrt(robust.weight);
  linear.residual *= root;
  linear.jacobian.leftCols(linear.columns) *= root;
  linear.cost = robust.cost;
}

}  // namespace

void linearize(const ExtraFactor& factor, const ExtraState& plane, const ExtraState& landmark,
               LinearFactor& linear) {
  linear.columns = 0;
  linear.residual.setZero();
  const double scale = 1.0 / factor.sigma;
  const Plane& at = plane.linearization().plane;
  const Eigen::Matrix<double, 3, 2> basis = at.basis();
  if (factor.tiesPoint()) {
    const Eigen::Vector3d& p = landmark.linearization().point;
    linear.residual[0] = scale * plane.x.plane.height(landmark.x.point);
    linear.addVariable(landmark.offset, scale * at.normal().transpose());
    Eigen::RowVector3d J;
    J << p.transpose() * basis, -1;
    linear.addVariable(plane.offset, scale * J);
    weigh(kInformationScale1, linear);
  } else if (factor.kind == ExtraFactorKind::kHorizontalPlane) {
    linear.residual.head<2>() = scale * plane.x.plane.normal().head<2>();
    linear.addVariable(plane.offset, scale * basis.topRows<2>());
    weigh(kInformationScale, linear);
  } else {
    linear.residual[0] = scale * plane.x.plane.normal().z();
    linear.addVariable(plane.offset, scale * basis.row(2));
    weigh(kInformationScale1, linear);
  }
}

bool linearizeSighting(const CameraSighting& view, std::size_t camera, const RigPose& rig,
                       const SE3& T_body_cam, const CalibrationLayout& calibration, int pose_offset,
                       const ExtraState& landmark, LinearFactor& linear) {
  const PointBasis basis{Eigen::Vector3d::UnitX(), Eigen::Vector3d::UnitY()};  // of pointAt()
  Eigen::Vector2d r;
  SightingJacobians J;
  if (!reprojectionResidual(view, rig.current[camera], pointAt(landmark.x.point), r) ||
      !reprojectionJacobians(view, rig.linearization[camera], T_body_cam,
                             pointAt(landmark.linearization().point), basis, calibration.extrinsics, J)) {
    return false;
  }
  linear.columns = 0;
  linear.residual << r, 0;
  if (calibration.time_offset) {
    linear.addVariable(0, J.pose.leftCols<3>() * rig.omega_body + J.pose.rightCols<3>() * rig.v_world);
  }
  if (calibration.extrinsics) linear.addVariable(calibration.extrinsicOffset(camera), J.extrinsic);
  linear.addVariable(landmark.offset, -J.pose.rightCols<3>());
  linear.addVariable(pose_offset, J.pose);
  weigh(kInformationScale, linear);
  return true;
}

}  // namespace swiftlet
