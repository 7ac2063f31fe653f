#pragma once
// Times that the host adds to a sensor's message, and the camera's settings for the image.

namespace swiftlet {

struct HostTimes {
  double exposure = 0;  ///< middle of the exposure (IMU: the sample's stamp); host's monotonic clock [s]
  double arrival = 0;   ///< when it was handed to the estimator; the same clock
  double open = 0;      ///< image: exposure time [s]; 0: unknown
  double gain = 0;      ///< image: gain as a multiple of the camera's lowest; 0: unknown
};

}  // namespace swiftlet
