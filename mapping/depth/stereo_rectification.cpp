#include "mapping/depth/stereo_rectification.hpp"

#include <algorithm>
#include <cmath>

namespace swiftlet {
namespace {

/// Least baseline [m].
constexpr double kLeastBaseline = 1e-3;
/// Cosine of the largest angle between a camera's axis and the rectified one: 60 degrees.
constexpr double kLeastCosine = 0.5;

struct Field {
  double left = -StereoRectification::kMaxFieldTangent;
  double right = StereoRectification::kMaxFieldTangent;
  double top = -StereoRectification::kMaxFieldTangent;
  double bottom = StereoRectification::kMaxFieldTangent;
};

// Reduces the field to what lies inside the raw image's border. Field: x/z and y/z in the rectified frame.
// Border rays at 90 degrees or more are ignored, because a pinhole's field does not reach them.
void cutToBorder(const CameraModel& camera, const Eigen::Matrix3d& R_rectified_cam, Field& field) {
  // The raw border pixel at (u, v); `edge` is the side of the field that it bounds.
  const auto cut = [&](double u, double v, double& edge, int axis, bool upper) {
    Eigen::Vector3d bearing;
    if (!camera.unproject({u, v}, bearing)) return;
    const Eigen::Vector3d ray = R_rectified_cam * bearing;
    if (ray.z() <= 0) return;
    const double tangent = ray[axis] / ray.z();
    edge = upper ? std::min(edge, tangent) : std::max(edge, tangent);
  };
  const double last_u = camera.width() - 1;
  const double last_v = camera.height() - 1;
  for (int v = 0; v < camera.height(); ++v) {
    cut(0, v, field.left, 0, false);
    cut(last_u, v, field.right, 0, true);
  }
  for (int u = 0; u < camera.width(); ++u) {
    cut(u, 0, field.top, 1, false);
    cut(u, last_v, field.bottom, 1, true);
  }
}

}  // namespace

StereoRectification::StereoRectification(const Rig& rig) : status_(build(rig)) {}

Status StereoRectification::build(const Rig& rig) {
  const auto refuse = [](const char* what) { return Status{StatusCode::kInvalidInput, what}; };
  if (rig.camera_count != 2) return refuse("rectification: needs two cameras");
  const int width = rig.camera[0].width();
  const int height = rig.camera[0].height();
  if (width != rig.camera[1].width() || height != rig.camera[1].height())
    return refuse("rectification: the cameras differ in size");
  if (width < 2 || height < 2 || width > ImageWarp::kMaxSide || height > ImageWarp::kMaxSide)
    return refuse("rectification: the cameras' size is not between 2 and 16384 pixels");
  baseline_ = rig.baseline();
  if (!(baseline_ > kLeastBaseline)) return refuse("rectification: the cameras have the same position");
  chooseRotations(rig);
  const auto looks_ahead = [](const Eigen::Matrix3d& R) { return R.allFinite() && R(2, 2) > kLeastCosine; };
  if (!looks_ahead(R_cam_rectified_[0]) || !looks_ahead(R_cam_rectified_[1]) || !chooseIntrinsics(rig))
    return refuse("rectification: the cameras share no field of view");
  T_body_camera_ = rig.T_body_cam[0] * SE3(R_cam_rectified_[0], Eigen::Vector3d::Zero());
  for (std::size_t c = 0; c < 2; ++c) warps_[c] = ImageWarp(rig.camera[c], R_cam_rectified_[c], intrinsics_);
  return okStatus();
}

void StereoRectification::chooseRotations(const Rig& rig) {
  const SE3 T_cam0_cam1 = rig.T_cam1_cam0().inverse();
  const Eigen::Matrix3d R_cam0_cam1 = T_cam0_cam1.R();
  const Eigen::Vector3d x = T_cam0_cam1.translation.normalized();
  const Eigen::Vector3d axis = Eigen::Vector3d::UnitZ() + R_cam0_cam1.col(2);
  const Eigen::Vector3d y = axis.cross(x).normalized();
  R_cam_rectified_[0].col(0) = x;
  R_cam_rectified_[0].col(1) = y;
  R_cam_rectified_[0].col(2) = x.cross(y);
  R_cam_rectified_[1] = R_cam0_cam1.transpose() * R_cam_rectified_[0];
}

bool StereoRectification::chooseIntrinsics(const Rig& rig) {
  Field field;
  for (std::size_t c = 0; c < 2; ++c) cutToBorder(rig.camera[c], R_cam_rectified_[c].transpose(), field);
  const double width = rig.camera[0].width() - 1;
  const double height = rig.camera[0].height() - 1;
  if (!(field.right > field.left) || !(field.bottom > field.top)) return false;
  const double f = std::max(width / (field.right - field.left), height / (field.bottom - field.top));
  intrinsics_.fx = intrinsics_.fy = f;
  intrinsics_.cx = 0.5 * (width - f * (field.left + field.right));
  intrinsics_.cy = 0.5 * (height - f * (field.top + field.bottom));
  intrinsics_.width = rig.camera[0].width();
  intrinsics_.height = rig.camera[0].height();
  return true;
}

}  // namespace swiftlet
