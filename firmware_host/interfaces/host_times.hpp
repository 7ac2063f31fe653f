#pragma once
// What the host adds to a sensor's message.

namespace swiftlet {

/// Times of the host's monotonic clock [s].
struct HostTimes {
  double exposure = 0;  ///< middle of the exposure (IMU: the sample's stamp)
  double arrival = 0;   ///< handed to the estimator
};

}  // namespace swiftlet
