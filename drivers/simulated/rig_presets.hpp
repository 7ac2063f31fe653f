#pragma once
// Camera rigs for simulated flights.

#include "drivers/simulated/flight_path.hpp"
#include "estimator/camera/rig.hpp"

namespace swiftlet {

enum class RigKind {
  kEuroc,          ///< EuRoC's rig: 752 x 480, radial-tangential, 11 cm baseline, IMU x up and z forward
  kForward,        ///< 640 x 400, radial-tangential, 8 cm baseline, IMU forward-left-up, looks 15 deg down
  kWide,           ///< 640 x 480, equidistant, about 130 degrees across, 10 cm baseline, IMU forward-left-up
  kFisheye,        ///< 640 x 480, equidistant, 180 degrees across, 10 cm baseline, IMU turned oddly
  kRandomPinhole,  ///< drawn by a seed (calibration_rig.hpp), radial-tangential
  kRandomFisheye,  ///< the same, equidistant
};
inline bool isRandom(RigKind kind) {
  return kind == RigKind::kRandomPinhole || kind == RigKind::kRandomFisheye;
}
const char* rigName(RigKind kind);

/// A rig, and the orientation of its body axes (the IMU's) in the airframe (forward-left-up).
struct MountedRig {
  Rig rig;
  Eigen::Quaterniond R_flu_body = Eigen::Quaterniond::Identity();
};
/// For kinds that are not random.
MountedRig makeRig(RigKind kind);

/// Mounted so that camera 0 looks forward and stands upright.
MountedRig mountForward(const Rig& rig);

/// The same rig and airframe with another IMU orientation.
MountedRig turnImu(const MountedRig& mounted, const Eigen::Quaterniond& R_flu_body);

}  // namespace swiftlet
