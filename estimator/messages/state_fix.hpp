#pragma once
// A solved state for propagation, which restarts from it.

#include "estimator/core/stamp.hpp"
#include "estimator/messages/gyro_intrinsics.hpp"
#include "estimator/messages/nav_state.hpp"
#include "estimator/messages/noise_in_use.hpp"

namespace swiftlet {

struct StateFix {
  bool has_state = false;  ///< false: the epoch has begun but has no state yet
  NavState state;       ///< at the image's instant on the IMU's clock; its epoch is valid without a state too
  GyroIntrinsics gyro;  ///< estimated together with its bias
  ImuFactors imu;       ///< on the noise, as found in flight
  Stamp last_accepted;  ///< the newest image whose tracks were accepted; health degrades with its age
  double good_age = 0;  ///< s: age beyond which health is not good
  std::uint32_t timeline = 0;  ///< TrackedFrame::timeline of the frame it comes from
};

}  // namespace swiftlet
