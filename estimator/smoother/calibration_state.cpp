#include "estimator/smoother/calibration_state.hpp"

#include "estimator/geometry/so3.hpp"
#include "estimator/messages/calibration_estimate.hpp"

namespace swiftlet {

CalibrationState::CalibrationState(const Rig& rig, bool estimate_time_offset, bool estimate_extrinsics)
    : layout_{estimate_time_offset, estimate_extrinsics, rig.camera_count,
              estimate_time_offset && rig.rolls()},
      now_{rig.camera_to_imu_shift.seconds(), rig.readout.seconds(), rig.T_body_cam},
      reference_(now_),
      backup_(now_) {}

void CalibrationState::hold(MatrixMap H) {
  reference_ = now_;
  if (layout_.time_offset) H(0, 0) = 1.0 / (kTimeOffsetPriorSigma * kTimeOffsetPriorSigma);
  if (layout_.readout) H(1, 1) = 1.0 / (kReadoutPriorSigma * kReadoutPriorSigma);
  if (!layout_.extrinsics) return;
  for (std::size_t c = 0; c < layout_.cameras; ++c) {
    const int at = layout_.extrinsicOffset(c);
    for (int k = 0; k < 3; ++k) {
      H(at + k, at + k) = 1.0 / (kExtrinsicRotationPriorSigma * kExtrinsicRotationPriorSigma);
      H(at + 3 + k, at + 3 + k) = 1.0 / (kExtrinsicPositionPriorSigma * kExtrinsicPositionPriorSigma);
    }
  }
  if (layout_.cameras > 1) holdBaseline(H);
}

// Adds information on the length of the baseline only: a rotation of the whole rig rotates the baseline too.
void CalibrationState::holdBaseline(MatrixMap H) const {
  const Eigen::Vector3d baseline = now_.T_body_cam[1].translation - now_.T_body_cam[0].translation;
  const double sigma = kBaselinePriorSigma * baseline.norm();
  if (sigma <= 0) return;
  const Eigen::Vector3d u = baseline.normalized();
  const Eigen::Matrix3d information = u * u.transpose() / (sigma * sigma);
  const int p0 = layout_.extrinsicOffset(0) + 3;
  const int p1 = layout_.extrinsicOffset(1) + 3;
  H.block<3, 3>(p0, p0) += information;
  H.block<3, 3>(p1, p1) += information;
  H.block<3, 3>(p0, p1) -= information;
  H.block<3, 3>(p1, p0) -= information;
}

CalibrationState::Vector CalibrationState::deviation() const {
  Vector d = Vector::Zero();
  if (layout_.time_offset) d[0] = now_.time_offset - reference_.time_offset;
  if (layout_.readout) d[1] = now_.readout - reference_.readout;
  if (!layout_.extrinsics) return d;
  for (std::size_t c = 0; c < layout_.cameras; ++c) {
    const int at = layout_.extrinsicOffset(c);
    const SE3& now = now_.T_body_cam[c];
    const SE3& then = reference_.T_body_cam[c];
    d.segment<3>(at) = logSo3(then.rotation.conjugate() * now.rotation);
    d.segment<3>(at + 3) = now.translation - then.translation;
  }
  return d;
}

void CalibrationState::retract(const Eigen::Ref<const Eigen::VectorXd>& step) {
  if (layout_.time_offset) now_.time_offset += step[0];
  if (layout_.readout) now_.readout += step[1];
  if (!layout_.extrinsics) return;
  for (std::size_t c = 0; c < layout_.cameras; ++c) {
    const int at = layout_.extrinsicOffset(c);
    SE3& T = now_.T_body_cam[c];
    T.rotation = (T.rotation * expSo3(step.segment<3>(at))).normalized();
    T.translation += step.segment<3>(at + 3);
  }
}

}  // namespace swiftlet
