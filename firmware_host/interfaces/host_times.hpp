#pragma once
// What the host adds to a sensor's message.

namespace swiftlet {

struct HostTimes {
  double exposure = 0;  ///< middle of the exposure (IMU: the sample's stamp); host's monotonic clock [s]
  double arrival = 0;   ///< handed to the estimator; the same clock
  double open = 0;      ///< of an image: how long the shutter was open [s]; 0: unknown
  double gain = 0;      ///< of an image: times the camera's least; 0: unknown
};

}  // namespace swiftlet
