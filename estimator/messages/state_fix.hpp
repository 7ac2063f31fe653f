#pragma once
// A solved state on its way to propagation, which starts again from it.

#include "estimator/core/stamp.hpp"
#include "estimator/messages/gyro_intrinsics.hpp"
#include "estimator/messages/nav_state.hpp"

namespace swiftlet {

struct StateFix {
  bool has_state = false;  ///< false: the epoch has begun, its first state has not been found yet
  NavState state;       ///< at the image's instant on the IMU's clock; its epoch counts without a state too
  GyroIntrinsics gyro;  ///< that go with its bias
  Stamp last_accepted;  ///< the newest image whose tracks were accepted; ages the health
  std::uint32_t timeline = 0;  ///< TrackedFrame::timeline of the frame it comes from
};

}  // namespace swiftlet
