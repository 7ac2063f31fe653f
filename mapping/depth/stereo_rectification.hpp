#pragma once
// Two raw cameras to one ideal pair: the same pinhole intrinsics, no distortion, rows aligned, so that a
// point at depth z is seen on one row, x_right = x_left - f b / z.
//
// Geometry: the rectified frames' x axis is the baseline (cam0 to cam1); z is the mean of the two optical
// axes, made perpendicular to it. The image keeps the raw size; focal length and centre are such that every
// rectified pixel sees both raw images, as large a field as that allows, within kMaxFieldTangent for
// fisheyes. Source: Fusiello, Trucco, Verri, Machine Vision and Applications 2000.

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

  /// Two cameras of one size. `status()` says what is wrong with others; nothing can be rectified then.
  explicit StereoRectification(const Rig& rig);

  [[nodiscard]] const Status& status() const { return status_; }
  /// Of both rectified images.
  [[nodiscard]] const PinholeIntrinsics& intrinsics() const { return intrinsics_; }
  [[nodiscard]] double baseline() const { return baseline_; }
  /// Rectified camera 0 to body.
  [[nodiscard]] const SE3& T_body_camera() const { return T_body_camera_; }
  /// Rectified camera to raw camera.
  [[nodiscard]] const Eigen::Matrix3d& R_cam_rectified(std::size_t camera) const {
    return R_cam_rectified_[camera];
  }

  /// Raw images of a camera to the rectified geometry; camera 0's label images too.
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
  Status status_;  ///< last: building fills the others
};

}  // namespace swiftlet
