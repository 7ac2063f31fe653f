#pragma once
// Rectifies two raw cameras to an ideal pair: equal pinhole intrinsics, no distortion, aligned rows, so that
// a point at depth z is on the same row of both, with x_right = x_left - f b / z.
//
// Geometry: the x axis of the rectified frames is the baseline (cam0 to cam1); z is the mean of the two
// optical axes, made perpendicular to it. The image keeps the raw size. Focal length and centre give the
// largest field in which every rectified pixel sees both raw images, within kMaxFieldTangent for fisheyes.
// Source: Fusiello, Trucco, Verri, Machine Vision and Applications 2000.

#include <Eigen/Core>
#include <array>
#include <cstddef>

#include "estimator/camera/rig.hpp"
#include "estimator/core/status.hpp"
#include "estimator/messages/depth_image.hpp"
#include "mapping/depth/image_warp.hpp"

namespace swiftlet {

class StereoRectification {
 public:
  /// Largest tangent of the angle between a ray and the axis, in x and in y: 56 degrees.
  static constexpr double kMaxFieldTangent = 1.5;

  /// Needs two cameras of one size. For other rigs `status()` gives the reason and nothing can be rectified.
  explicit StereoRectification(const Rig& rig);

  [[nodiscard]] const Status& status() const { return status_; }
  /// Intrinsics of both rectified images.
  [[nodiscard]] const PinholeIntrinsics& intrinsics() const { return intrinsics_; }
  [[nodiscard]] double baseline() const { return baseline_; }
  /// Rectified camera 0 to body.
  [[nodiscard]] const SE3& T_body_camera() const { return T_body_camera_; }
  /// Rectified camera to raw camera.
  [[nodiscard]] const Eigen::Matrix3d& R_cam_rectified(std::size_t camera) const {
    return R_cam_rectified_[camera];
  }

  /// Warps raw images of a camera to the rectified geometry, and label images of camera 0.
  [[nodiscard]] const ImageWarp& warp(std::size_t camera) const { return warps_[camera]; }

 private:
  [[nodiscard]] Status build(const Rig& rig);
  void chooseRotations(const Rig& rig);
  [[nodiscard]] bool chooseIntrinsics(const Rig& rig);

  PinholeIntrinsics intrinsics_;
  double baseline_ = 0;
  SE3 T_body_camera_;
  std::array<Eigen::Matrix3d, kMaxCameras> R_cam_rectified_;
  std::array<ImageWarp, kMaxCameras> warps_;
  Status status_;  ///< declared last, because its initialization sets the other members
};

}  // namespace swiftlet
