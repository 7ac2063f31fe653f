#pragma once
// The turn of a rolling shutter's rows, from the gyro.
//
// Where samples end at the image's stamp, as in a log whose messages are in the order of their stamps, the
// rate behind it goes on as it changed before. Cost: about 1 us. Nothing is allocated.

#include <Eigen/Core>
#include <span>

#include "estimator/core/stamp.hpp"
#include "estimator/messages/gyro_intrinsics.hpp"
#include "estimator/messages/imu_sample.hpp"
#include "estimator/messages/scan_motion.hpp"

namespace swiftlet {

/// `samples`: those from a readout before the middle to half of one behind it, in order, as far as there are
/// any; without any there is no turn. The middle's stamp is the IMU clock's.
ScanTurn scanTurn(std::span<const ImuSample> samples, Stamp middle, Duration readout,
                  const Eigen::Vector3d& bias_gyro, const GyroIntrinsics& intrinsics);

}  // namespace swiftlet
