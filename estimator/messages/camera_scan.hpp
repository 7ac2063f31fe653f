#pragma once
// Motion of a camera while the rows of a rolling shutter are read: transforms between the camera at a row and
// at the middle row.
//
// Points and rays are in camera axes, at the image's stamp (the time of the middle row) or `seconds` after it
// (Rig::rowTime). The velocity is constant while the rows are read; the rotation is that of ScanTurn. Metres,
// seconds. Cost: 0.1 us per point. No allocation.

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "estimator/geometry/se3.hpp"
#include "estimator/messages/scan_motion.hpp"

namespace swiftlet {

class CameraScan {
 public:
  CameraScan(const SE3& T_body_cam, const ScanMotion& motion)
      : R_cam_body_(T_body_cam.rotation.conjugate()),
        turn_(motion.turn),
        velocity_(R_cam_body_ * (motion.v_body + motion.turn.mean().cross(T_body_cam.translation))) {}

  /// R_middle_row
  [[nodiscard]] Eigen::Quaterniond turnAt(double seconds) const {
    return R_cam_body_ * turn_.at(seconds) * R_cam_body_.conjugate();
  }
  /// Transforms a point from the camera at the middle row to that at the row, and back.
  [[nodiscard]] Eigen::Vector3d atRow(const Eigen::Vector3d& p, double seconds) const {
    return turnAt(seconds).conjugate() * (p - seconds * velocity_);
  }
  [[nodiscard]] Eigen::Vector3d fromRow(const Eigen::Vector3d& p, double seconds) const {
    return turnAt(seconds) * p + seconds * velocity_;
  }
  /// m/s: velocity of a static point in camera axes, averaged over the rows.
  [[nodiscard]] Eigen::Vector3d flow(const Eigen::Vector3d& p) const {
    return -(R_cam_body_ * turn_.mean()).cross(p) - velocity_;
  }

 private:
  Eigen::Quaterniond R_cam_body_;
  ScanTurn turn_;
  Eigen::Vector3d velocity_;  // m/s, camera axes
};

}  // namespace swiftlet
