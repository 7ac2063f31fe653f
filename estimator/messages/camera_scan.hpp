#pragma once
// One camera while a rolling shutter's rows are read: what a row sees, seen from the middle row, and back.
//
// Points and rays are in the camera's axes, at the image's stamp (the middle row's time) or `seconds` after
// it (Rig::rowTime). The velocity is constant while the rows are read, the turn is ScanTurn's. Metres,
// seconds. Cost: 0.1 us a point. Nothing is allocated.

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
  /// A point of the middle row's camera in the row's, and back.
  [[nodiscard]] Eigen::Vector3d atRow(const Eigen::Vector3d& p, double seconds) const {
    return turnAt(seconds).conjugate() * (p - seconds * velocity_);
  }
  [[nodiscard]] Eigen::Vector3d fromRow(const Eigen::Vector3d& p, double seconds) const {
    return turnAt(seconds) * p + seconds * velocity_;
  }
  /// m/s: how a point that stands still moves in the camera's axes, on the mean over the rows.
  [[nodiscard]] Eigen::Vector3d flow(const Eigen::Vector3d& p) const {
    return -(R_cam_body_ * turn_.mean()).cross(p) - velocity_;
  }

 private:
  Eigen::Quaterniond R_cam_body_;
  ScanTurn turn_;
  Eigen::Vector3d velocity_;  // m/s, camera axes
};

}  // namespace swiftlet
