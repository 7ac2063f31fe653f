#pragma once
// The rotation of the body while the rows of a rolling shutter are read, from the gyro.
//
// If samples end at the image's stamp, as in a log ordered by stamp, the rate after it is extrapolated from
// its change before. Cost: about 1 us. No allocation.

#include <Eigen/Core>
#include <span>

#include "estimator/core/stamp.hpp"
#include "estimator/messages/gyro_intrinsics.hpp"
#include "estimator/messages/imu_sample.hpp"
#include "estimator/messages/scan_motion.hpp"

namespace swiftlet {

/// `samples`: from one readout time before the middle row to half of one after it, in order, as far as
/// available; without samples the rotation is zero. The stamp of the middle row is on the IMU's clock.
ScanTurn scanTurn(std::span<const ImuSample> samples, Stamp middle, Duration readout,
                  const Eigen::Vector3d& bias_gyro, const GyroIntrinsics& intrinsics);

}  // namespace swiftlet
